#include "components/runtime/process.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/fake_participant.hpp"
#include "components/runtime/testing/harness.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "middleware/participant.hpp"
#include "rcl_interfaces/msg/log.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "std_msgs/msg/int32.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using std_msgs::msg::Int32;
using ::testing::ElementsAre;
using testing::eventually;
using testing::FakeDomain;
using ::testing::HasSubstr;

std::atomic<int> heard = 0;
std::atomic<std::int64_t> clock_seen = 0;

class Emitter final : public Component {
  Param<std::int64_t> count_{*this, "count", 5, Range{0, 1000}};
  Output<Int32> numbers_{*this, "numbers", Qos::latched(100)};
  Result<void> activate() override {
    for (int i = 0; i < count_; ++i) numbers_.publish(Int32{});
    log().info("sent {}", count_.value());
    return {};
  }
};
ADIT_COMPONENT(Emitter, "test_emitter");

class Hearer final : public Component {
  Param<bool> explode_{*this, "explode", false};
  Input<Int32> numbers_{*this, "numbers", Qos::latched(100), Queue{100}, [this](const Int32&, const MessageInfo&) {
                          if (explode_) throw std::runtime_error("boom");
                          ++heard;
                          clock_seen = clock().now().time_since_epoch().count();
                        }};
};
ADIT_COMPONENT(Hearer, "test_hearer");

class Fragile final : public Component {
 public:
  Fragile() { throw std::runtime_error("no"); }
};
ADIT_COMPONENT(Fragile, "test_fragile");

ComponentConfig component(const std::string& type, const std::string& name, Value::Map parameters = {}) {
  ComponentConfig config;
  config.type = type;
  config.name = name;
  config.parameters = std::move(parameters);
  return config;
}

ProcessConfig two_components() {
  ProcessConfig config;
  config.name = "test_process";
  config.log_level = LogLevel::off;
  config.components = {component("test_hearer", "hearer"), component("test_emitter", "emitter")};
  for (ComponentConfig& c : config.components) c.log_level = LogLevel::off;
  return config;
}

TEST(Process, RunsItsComponentsUntilItIsStopped) {
  heard = 0;
  auto process = Process::build(two_components());
  ASSERT_TRUE(process) << process.error().message;
  ASSERT_TRUE((*process)->connect(nullptr));
  ASSERT_TRUE((*process)->start());
  std::stop_source stop;
  int status = -1;
  std::jthread runner([&] { status = (*process)->run(stop.get_token()); });
  EXPECT_TRUE(eventually([] { return heard == 5; }));
  stop.request_stop();
  runner.join();
  EXPECT_EQ(status, 0);
  (*process)->shutdown();
  for (const ComponentStatus& component_status : (*process)->status()) {
    EXPECT_EQ(component_status.state, LifecycleState::finalized);
  }
}

TEST(Process, ListsPortsAndParametersWithoutOpeningAnything) {
  ProcessConfig config = two_components();
  config.components[1].remap["numbers"] = "/other";
  auto process = Process::build(config);
  ASSERT_TRUE(process);
  const std::vector<PortInfo> ports = (*process)->ports();
  ASSERT_EQ(ports.size(), 2u);
  EXPECT_EQ(ports[0].topic, "/numbers");
  EXPECT_EQ(ports[1].topic, "/other");
  EXPECT_EQ(ports[1].type->ros_name, "std_msgs/msg/Int32");
  EXPECT_EQ((*process)->parameters()[1].second[0].name, "count");
}

TEST(Process, RefusesWhatCannotBeBuilt) {
  const auto error = [](ComponentConfig config) {
    ProcessConfig process = two_components();
    process.components.push_back(std::move(config));
    const auto built = Process::build(process);
    return built ? "" : built.error().message;
  };
  EXPECT_THAT(error(component("test_nothing", "x")), HasSubstr("unknown component 'test_nothing'. Known: "));
  EXPECT_THAT(error(component("test_nothing", "x")), HasSubstr("test_emitter"));
  EXPECT_THAT(error(component("../evil", "x")), HasSubstr("unknown component"));
  EXPECT_THAT(error(component("test_fragile", "x")), HasSubstr("threw while it was built: no"));
  EXPECT_THAT(error(component("test_emitter", "emitter")), HasSubstr("two components are called /emitter"));
  EXPECT_THAT(error(component("test_emitter", "x", {{"count", -1}})), HasSubstr("outside its range [0, 1000]"));
}

TEST(Process, AComponentIsLoadedFromItsLibraryByName) {
  ProcessConfig config = two_components();
  config.components = {component("listener", "listener")};
  auto process = Process::build(config);
  ASSERT_TRUE(process) << process.error().message;
  EXPECT_EQ((*process)->ports()[0].topic, "/chatter");
}

TEST(Process, AFailedComponentIsInTheExitStatusAndTheOthersGoOn) {
  heard = 0;
  ProcessConfig config = two_components();
  config.components.insert(config.components.begin(), component("test_hearer", "bad", {{"explode", true}}));
  config.components[0].log_level = LogLevel::off;
  config.exit_when_a_component_fails = true;
  auto process = Process::build(config);
  ASSERT_TRUE(process);
  std::string failed;
  (*process)->on_failure([&](const std::string& name, const std::string& reason) { failed = name + " " + reason; });
  ASSERT_TRUE((*process)->connect(nullptr));
  ASSERT_TRUE((*process)->start());
  EXPECT_EQ((*process)->run({}), 1);
  EXPECT_TRUE(eventually([] { return heard == 5; }));
  EXPECT_THAT(failed, HasSubstr("/bad stopped: a handler threw an exception: boom"));
}

TEST(Process, BringsComponentsToAState) {
  ProcessConfig config = two_components();
  config.components[0].start = LifecycleState::unconfigured;
  auto process = Process::build(config);
  ASSERT_TRUE(process);
  ASSERT_TRUE((*process)->connect(nullptr));
  ASSERT_TRUE((*process)->start());
  EXPECT_EQ((*process)->status()[0].state, LifecycleState::unconfigured);
  EXPECT_EQ((*process)->status()[1].state, LifecycleState::active);
  ASSERT_TRUE((*process)->bring("/hearer", LifecycleState::active));
  EXPECT_EQ((*process)->status()[0].state, LifecycleState::active);
  ASSERT_TRUE((*process)->bring("/hearer", LifecycleState::unconfigured));
  EXPECT_EQ((*process)->status()[0].state, LifecycleState::unconfigured);
  const auto unknown = (*process)->bring("/nobody", LifecycleState::active);
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().message, HasSubstr("/hearer, /emitter"));
}

template <class T>
struct Watcher final : Component {
  Watcher(const std::string& topic, const Qos& qos)
      : input{*this, topic, qos, Queue{1000}, [this](const T& message, const MessageInfo&) {
                const std::lock_guard lock(mutex);
                messages.push_back(message);
              }} {}
  std::vector<T> seen() {
    const std::lock_guard lock(mutex);
    return messages;
  }
  std::mutex mutex;
  std::vector<T> messages;
  Input<T> input;
};

TEST(Process, TellsDiagnosticsAndRosout) {
  using diagnostic_msgs::msg::DiagnosticArray;
  FakeDomain domain;
  testing::Harness other(1, domain.join());
  auto& diagnostics = other.make<Watcher<DiagnosticArray>>("diagnostics", {}, "/diagnostics", Qos::reliable(10));
  auto& rosout = other.make<Watcher<rcl_interfaces::msg::Log>>("rosout", {}, "/rosout", Qos::rosout());
  other.start();
  ProcessConfig config = two_components();
  config.components[1].log_level = LogLevel::info;
  auto process = Process::build(config);
  ASSERT_TRUE(process);
  ASSERT_TRUE((*process)->connect(domain.join()));
  ASSERT_TRUE((*process)->start());
  ASSERT_TRUE(eventually([&] { return !diagnostics.seen().empty() && !rosout.seen().empty(); }));
  const DiagnosticArray array = diagnostics.seen().front();
  ASSERT_EQ(array.status.size(), 2u);
  EXPECT_EQ(array.status[0].name, "/hearer");
  EXPECT_EQ(array.status[0].message, "active");
  EXPECT_THAT(array.status[0].values[5].value, HasSubstr("topic=/numbers handled=5"));
  const auto log = rosout.seen().front();
  EXPECT_EQ(log.name, "emitter");
  EXPECT_EQ(log.msg, "sent 5");
  EXPECT_EQ(log.level, 20);
}

TEST(Process, LivesInTheTimeThatClockTells) {
  FakeDomain domain;
  clock_seen = 0;
  ProcessConfig config = two_components();
  config.use_sim_time = true;
  config.components[1].start = LifecycleState::inactive;
  auto process = Process::build(config);
  ASSERT_TRUE(process);
  ASSERT_TRUE((*process)->connect(domain.join()));
  ASSERT_TRUE((*process)->start());
  const auto remote = domain.join();
  EndpointConfig endpoint;
  endpoint.topic = "/clock";
  endpoint.type = &type_info<rosgraph_msgs::msg::Clock>();
  endpoint.qos = Qos::clock();
  auto writer = remote->writer(endpoint);
  ASSERT_TRUE(writer);
  rosgraph_msgs::msg::Clock now;
  now.clock.sec = 1234;
  ASSERT_TRUE((*writer)->publish(MessageEncoder(now)));
  std::this_thread::sleep_for(50ms);
  ASSERT_TRUE((*process)->bring("/emitter", LifecycleState::active));
  EXPECT_TRUE(eventually([] { return clock_seen == 1'234'000'000'000; }));
}

}  // namespace
}  // namespace adit
