// Lifecycle, strands, failures, parameters as a component meets them.
#include "components/runtime/component.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

#include "components/runtime/testing/harness.hpp"
#include "std_msgs/msg/int32.hpp"

namespace adit {
namespace {

using std_msgs::msg::Int32;
using ::testing::ElementsAre;
using testing::eventually;
using testing::Harness;
using ::testing::HasSubstr;

struct Recorder final : Component {
  std::vector<std::string> calls;
  std::string refuse;
  Result<void> note(const std::string& call) {
    calls.push_back(call);
    if (call == refuse) return Error{ErrorCode::invalid_argument, "because"};
    return {};
  }
  Result<void> configure() override { return note("configure"); }
  Result<void> activate() override { return note("activate"); }
  Result<void> deactivate() override { return note("deactivate"); }
  Result<void> cleanup() override { return note("cleanup"); }
};

TEST(Component, WalksThroughItsLifecycle) {
  Harness harness;
  auto& component = harness.make<Recorder>("component");
  ComponentCore& core = component.core();
  EXPECT_EQ(core.state(), LifecycleState::unconfigured);
  ASSERT_TRUE(core.configure());
  EXPECT_EQ(core.state(), LifecycleState::inactive);
  ASSERT_TRUE(core.activate());
  EXPECT_EQ(core.state(), LifecycleState::active);
  core.shutdown();
  EXPECT_EQ(core.state(), LifecycleState::finalized);
  EXPECT_THAT(component.calls, ElementsAre("configure", "activate", "deactivate", "cleanup"));
}

TEST(Component, RefusesATransitionThatItsStateDoesNotAllow) {
  Harness harness;
  auto& component = harness.make<Recorder>("component");
  const auto result = component.core().activate();
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("unconfigured"));
  EXPECT_TRUE(component.calls.empty());
}

TEST(Component, ARefusedTransitionLeavesTheStateAndSaysWhy) {
  Harness harness;
  auto& component = harness.make<Recorder>("component");
  component.refuse = "configure";
  const auto result = component.core().configure();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "/component: configure failed: because");
  EXPECT_EQ(component.core().state(), LifecycleState::unconfigured);
}

struct Counter final : Component {
  explicit Counter(int throw_at = -1) : throw_at_(throw_at) {}
  std::atomic<int> inside{0}, most_inside{0}, handled{0};
  void handle(int number) {
    most_inside = std::max<int>(most_inside, ++inside);
    if (number == throw_at_) throw std::runtime_error("the roof is on fire");
    std::this_thread::sleep_for(std::chrono::microseconds(200));
    ++handled;
    --inside;
  }
  int throw_at_;
  Input<Int32> a{*this, "a", Qos::reliable(10), Queue{1000},
                 [this](const Int32& m, const MessageInfo&) { handle(m.data); }};
  Input<Int32> b{*this, "b", Qos::reliable(10), Queue{1000},
                 [this](const Int32& m, const MessageInfo&) { handle(m.data); }};
};

struct Source final : Component {
  Output<Int32> a{*this, "a", Qos::reliable(10)};
  Output<Int32> b{*this, "b", Qos::reliable(10)};
};

TEST(Component, ItsHandlersNeverRunConcurrently) {
  Harness harness(4);
  auto& source = harness.make<Source>("source");
  auto& counter = harness.make<Counter>("counter");
  harness.start();
  for (int i = 0; i < 200; ++i) {
    source.a.publish(Int32{});
    source.b.publish(Int32{});
  }
  ASSERT_TRUE(eventually([&] { return counter.handled == 400; }));
  EXPECT_EQ(counter.most_inside, 1);
}

TEST(Component, OneThatThrowsIsStoppedAndReportedAndTheOthersGoOn) {
  Harness harness(2);
  auto& source = harness.make<Source>("source");
  auto& bad = harness.make<Counter>("bad", {}, 3);
  auto& good = harness.make<Counter>("good");
  harness.start();
  for (int i = 0; i < 10; ++i) {
    Int32 message;
    message.data = i;
    source.a.publish(message);
  }
  ASSERT_TRUE(eventually([&] { return good.handled == 10 && bad.core().state() == LifecycleState::finalized; }));
  EXPECT_EQ(bad.handled, 3);
  const ComponentStatus status = bad.core().status();
  EXPECT_TRUE(status.failed);
  EXPECT_EQ(status.health, Health::error);
  EXPECT_THAT(status.reason, HasSubstr("the roof is on fire"));
  EXPECT_THAT(harness.failures(), ElementsAre(HasSubstr("/bad stopped")));
}

enum class Method { plain, genz };

struct Tunable final : Component {
  Param<double> max_range{*this, "max_range", 100.0, Unit::metre, Range{1.0, 300.0}, "points farther away are ignored"};
  Param<std::int64_t> iterations{*this, "icp.iterations", 50, Range{1, 1000}};
  Param<bool> deskew{*this, "deskew", true};
  Param<std::string> frame{*this, "frame", "lidar"};
  Param<std::vector<double>> offset{*this, "offset", {0.0, 0.0, 0.0}, Unit::metre};
  Param<Method> method{*this, "method", Method::plain, {{"plain", Method::plain}, {"genz", Method::genz}}};
};

ComponentConfig with(Value::Map parameters) {
  ComponentConfig config;
  config.type = "tunable";
  config.name = "lidar";
  config.parameters = std::move(parameters);
  return config;
}

std::string refusal(Value::Map parameters) {
  Tunable component;
  const auto result = component.core().bind(with(std::move(parameters)), std::make_shared<LogSink>(false));
  return result ? "" : result.error().message;
}

TEST(Param, IsSetFromTheDeployment) {
  Tunable component;
  const auto result = component.core().bind(with({{"max_range", 80},
                                                  {"icp", Value::Map{{"iterations", 20}}},
                                                  {"deskew", false},
                                                  {"frame", "velodyne"},
                                                  {"offset", Value::List{1, 2.5, 3}},
                                                  {"method", "genz"}}),
                                            std::make_shared<LogSink>(false));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(component.max_range, 80.0);
  EXPECT_EQ(component.iterations, 20);
  EXPECT_EQ(component.deskew, false);
  EXPECT_EQ(component.frame.value(), "velodyne");
  EXPECT_THAT(component.offset.value(), ElementsAre(1.0, 2.5, 3.0));
  EXPECT_EQ(component.method, Method::genz);
}

TEST(Param, RefusalsSayWhatWhereAndWhatIsAllowed) {
  Value located = 500.0;
  located.where = "tunnel.yaml:14";
  EXPECT_EQ(refusal({{"max_range", located}}),
            "tunnel.yaml:14: parameter 'max_range' of /lidar is 500 m, outside its range [1, 300] m");
  EXPECT_EQ(refusal({{"max_range", "far"}}),
            "parameter 'max_range' of /lidar is a string (\"far\"), but a number is wanted");
  EXPECT_EQ(refusal({{"icp", Value::Map{{"iterations", 2.5}}}}),
            "parameter 'icp.iterations' of /lidar is a floating-point number (2.5), but an integer is wanted");
  EXPECT_EQ(refusal({{"method", "magic"}}),
            "parameter 'method' of /lidar is \"magic\", but one of these is wanted: plain, genz");
  EXPECT_EQ(refusal({{"range", 1}}),
            "/lidar has no parameter 'range'; it has max_range, icp.iterations, deskew, frame, offset, method");
  EXPECT_THAT(refusal({{"max_range", std::nan("")}}), HasSubstr("finite"));
  EXPECT_THAT(refusal({{"offset", Value::List{1, "x"}}}), HasSubstr("a number is wanted"));
}

TEST(Param, ListsItselfForDocumentation) {
  Tunable component;
  const std::vector<ParamInfo> infos = component.core().parameters();
  ASSERT_EQ(infos.size(), 6u);
  EXPECT_EQ(infos[0].type, "double");
  EXPECT_EQ(infos[0].default_value, "100");
  EXPECT_EQ(symbol(infos[0].unit), "m");
  EXPECT_EQ(infos[0].description, "points farther away are ignored");
  EXPECT_THAT(infos[5].choices, ElementsAre("plain", "genz"));
}

TEST(Component, AnUnknownPortInARemapListsTheKnownOnes) {
  Source source;
  ComponentConfig config;
  config.name = "source";
  config.remap["c"] = "/d";
  const auto result = source.core().bind(config, std::make_shared<LogSink>(false));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "/source has no port 'c' to remap; its inputs: none; its outputs: a, b");
}

}  // namespace
}  // namespace adit
