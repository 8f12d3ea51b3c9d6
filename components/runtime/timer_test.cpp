#include "components/runtime/timer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/harness.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using testing::eventually;
using testing::Harness;

Time at(Duration time) {
  return Time(time);
}

struct Ticking final : Component {
  explicit Ticking(Duration period) : timer{*this, "tick", period, [this](const TimerTick& tick) { on_tick(tick); }} {}
  void on_tick(const TimerTick& tick) {
    const std::lock_guard lock(mutex);
    scheduled.push_back(tick.scheduled.time_since_epoch());
    missed.push_back(tick.missed);
    if (nap > Duration::zero()) std::this_thread::sleep_for(std::exchange(nap, Duration::zero()));
  }
  void on_time_jump(Duration step) override { jumps.push_back(step); }
  std::size_t ticks() {
    const std::lock_guard lock(mutex);
    return scheduled.size();
  }
  std::mutex mutex;
  std::vector<Duration> scheduled;
  std::vector<std::uint64_t> missed;
  std::vector<Duration> jumps;
  Duration nap{};
  Timer timer;
};

TEST(Timer, FiresAtItsSimulatedTimes) {
  Harness harness(0, nullptr, Clock::Source::simulated);
  harness.clock.set(at(1s));
  auto& ticking = harness.make<Ticking>("ticking", {}, 100ms);
  harness.start();
  for (Duration t : {1050ms, 1100ms, 1150ms, 1200ms}) {
    harness.set_time(at(t));
    harness.step();
  }
  EXPECT_THAT(ticking.scheduled, ElementsAre(1100ms, 1200ms));
  EXPECT_THAT(ticking.missed, ElementsAre(0, 0));
}

TEST(Timer, CountsTicksThatWereMissedAndKeepsItsSchedule) {
  Harness harness(0, nullptr, Clock::Source::simulated);
  harness.clock.set(at(0ms));
  auto& ticking = harness.make<Ticking>("ticking", {}, 100ms);
  harness.start();
  for (Duration t : {350ms, 400ms}) {
    harness.set_time(at(t));
    harness.step();
  }
  EXPECT_THAT(ticking.scheduled, ElementsAre(300ms, 400ms));
  EXPECT_THAT(ticking.missed, ElementsAre(2, 0));
  EXPECT_EQ(ticking.timer.stats().missed, 2u);
}

TEST(Timer, TheFirstTimeEverIsNoLongListOfMissedTicks) {
  Harness harness(0, nullptr, Clock::Source::simulated);
  auto& ticking = harness.make<Ticking>("ticking", {}, 100ms);
  harness.start();
  for (Duration t : {Duration(1000000s), Duration(1000000s + 100ms)}) {
    harness.set_time(at(t));
    harness.step();
  }
  EXPECT_THAT(ticking.scheduled, ElementsAre(1000000s + 100ms));
  EXPECT_THAT(ticking.missed, ElementsAre(0));
  EXPECT_TRUE(ticking.jumps.empty());
}

TEST(Timer, AJumpBackIsReportedAndTheScheduleStartsOver) {
  Harness harness(0, nullptr, Clock::Source::simulated);
  harness.clock.set(at(10s));
  auto& ticking = harness.make<Ticking>("ticking", {}, 100ms);
  harness.start();
  for (Duration t : {10100ms, 2000ms, 2050ms, 2100ms}) {
    harness.set_time(at(t));
    harness.step();
  }
  EXPECT_THAT(ticking.jumps, ElementsAre(-8100ms));
  EXPECT_THAT(ticking.scheduled, ElementsAre(10100ms, 2100ms));
}

TEST(Timer, DoesNotDriftOnTheSystemClock) {
  Harness harness(1);
  auto& ticking = harness.make<Ticking>("ticking", {}, 5ms);
  harness.start();
  ASSERT_TRUE(eventually([&] { return ticking.ticks() >= 40; }));
  const std::lock_guard lock(ticking.mutex);
  std::uint64_t missed = 0;
  for (const std::uint64_t n : ticking.missed) missed += n;
  const Duration span = ticking.scheduled.back() - ticking.scheduled.front();
  const Duration expected = 5ms * (ticking.scheduled.size() - 1 + missed - ticking.missed.front());
  EXPECT_LT(std::chrono::abs(span - expected), 1ms);
}

TEST(Timer, ASlowHandlerMakesItMissTicksNotQueueThem) {
  Harness harness(2);
  auto& ticking = harness.make<Ticking>("ticking", {}, 10ms);
  ticking.nap = 55ms;
  harness.start();
  ASSERT_TRUE(eventually([&] { return ticking.ticks() >= 3; }));
  EXPECT_GE(ticking.timer.stats().missed, 4u);
}

// A timer whose handler takes several of its periods is always due; what else the component has to do gets its turn.
struct Overrun final : Component {
  void publish_to_itself() { static_cast<void>(out.publish(std_msgs::msg::String{})); }
  Output<std_msgs::msg::String> out{*this, "words", Qos::reliable()};
  Input<std_msgs::msg::String> in{*this, "words", Qos::reliable(), Queue{2, WhenFull::drop_oldest},
                                  [this](const std_msgs::msg::String&, const MessageInfo&) { ++messages; }};
  Timer slow{*this, "slow", 1ms, [this](const TimerTick&) {
               std::this_thread::sleep_for(5ms);
               publish_to_itself();
             }};
  Timer other{*this, "other", 20ms, [this](const TimerTick&) { ++others; }};
  std::atomic<int> messages{0}, others{0};
};

TEST(Timer, OneThatOverrunsStarvesNeitherMessagesNorOtherTimers) {
  Harness harness(1);
  auto& overrun = harness.make<Overrun>("overrun");
  harness.start();
  EXPECT_TRUE(eventually([&] { return overrun.messages >= 3 && overrun.others >= 3; }));
}

TEST(Timer, StopsWithItsComponent) {
  Harness harness(1);
  auto& ticking = harness.make<Ticking>("ticking", {}, 1ms);
  harness.start();
  ASSERT_TRUE(eventually([&] { return ticking.ticks() > 2; }));
  ASSERT_TRUE(ticking.core().deactivate());
  const std::size_t ticks = ticking.ticks();
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(ticking.ticks(), ticks);
}

}  // namespace
}  // namespace adit
