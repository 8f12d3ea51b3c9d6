// What happens when a process of a running deployment is killed: it comes back, its component active, traffic flows
// again; nothing else stops.
#include <gmock/gmock.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <cstdio>

#include "idl/codec.hpp"
#include "middleware/participant.hpp"
#include "std_msgs/msg/string.hpp"
#include "tests/integration/adit_process.hpp"

namespace adit::integration {
namespace {

constexpr const char* talking = R"(
processes:
  - name: talking
    restart: {policy: on-failure, max: -1, backoff: 20ms, backoff_max: 100ms}
    components: [{type: talker, parameters: {rate: 200.0}}]
  - name: listening
    restart: {policy: on-failure, max: -1, backoff: 20ms, backoff_max: 100ms}
    components: [{type: listener, log_level: error}]
)";

class Supervision : public testing::TestWithParam<const char*> {};

// Counts what arrives on /chatter.
class Ear {
 public:
  Ear(const std::string& vendor, const std::string& domain) {
    ParticipantConfig config;
    config.vendor = vendor;
    config.domain = static_cast<std::uint32_t>(std::stoi(domain));
    participant_ = std::move(open(config)).value();
    EndpointConfig endpoint;
    endpoint.topic = "/chatter";
    endpoint.type = &type_info<std_msgs::msg::String>();
    endpoint.node = "/ear";
    reader_ = std::move(participant_->reader(endpoint)).value();
    reader_->on_data([this] { ready_ = true; });
  }
  ~Ear() { reader_->on_data(nullptr); }
  bool hears_within(double limit_s) {
    Sample sample;
    while (reader_->take({&sample, 1}) == 1) sample.reset();  // what was still on its way
    return wait_until(limit_s, [&] { return reader_->take({&sample, 1}) == 1; });
  }

 private:
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<Reader> reader_;
  std::atomic<bool> ready_{false};
};

TEST_P(Supervision, KilledProcessesAreBackWithTrafficWithinTwoSeconds) {
  const TemporaryFolder folder;
  const std::string domain = private_domain();
  Background run({"run", folder.write("talk.yaml", talking), "--quiet", "--middleware", GetParam(), "--domain", domain},
                 folder.file("log"));
  Ear ear(GetParam(), domain);
  ASSERT_TRUE(ear.hears_within(30.0));
  const std::vector<pid_t> listeners = children_of(run.pid(), "listening");
  ASSERT_EQ(listeners.size(), 1u);

  constexpr int kills = 20;
  double worst = 0.0;
  for (int i = 0; i < kills; ++i) {
    const std::vector<pid_t> victims = children_of(run.pid(), "talking");
    ASSERT_EQ(victims.size(), 1u);
    ::kill(victims.front(), SIGKILL);
    const auto killed = std::chrono::steady_clock::now();
    ASSERT_TRUE(wait_until(5.0, [&] {
      const auto now = children_of(run.pid(), "talking");
      return now.size() == 1 && now.front() != victims.front();
    }));
    ASSERT_TRUE(ear.hears_within(10.0));
    worst = std::max(worst, std::chrono::duration<double>(std::chrono::steady_clock::now() - killed).count());
  }
  std::printf("%s: %d kills of the talker, traffic back after at most %.2f s\n", GetParam(), kills, worst);
  EXPECT_LE(worst, 2.0);
  EXPECT_EQ(children_of(run.pid(), "listening"), listeners);  // nothing else was restarted

  // The listener too: killed and back, and the talker goes on.
  const std::vector<pid_t> talkers = children_of(run.pid(), "talking");
  ::kill(listeners.front(), SIGKILL);
  EXPECT_TRUE(wait_until(5.0, [&] {
    const auto now = children_of(run.pid(), "listening");
    return now.size() == 1 && now != listeners;
  }));
  EXPECT_EQ(children_of(run.pid(), "talking"), talkers);

  run.signal(SIGTERM);
  EXPECT_EQ(run.wait(20.0), 0);
}

TEST_P(Supervision, KilledSupervisorTakesItsProcessesAlong) {
  const TemporaryFolder folder;
  std::vector<pid_t> children;
  {
    Background run({"run", folder.write("talk.yaml", talking), "--quiet", "--middleware", GetParam(), "--domain",
                    private_domain()},
                   folder.file("log"));
    ASSERT_TRUE(wait_until(20.0, [&] {
      children = children_of(run.pid(), "talking");
      return !children.empty();
    }));
  }  // SIGKILL
  EXPECT_TRUE(wait_until(20.0, [&] { return ::kill(children.front(), 0) != 0; }));
}

INSTANTIATE_TEST_SUITE_P(Vendors, Supervision, testing::Values("fastdds", "cyclonedds"),
                         [](const auto& vendor) { return std::string(vendor.param); });

}  // namespace
}  // namespace adit::integration
