#include "components/state_estimator/replay_buffer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

using test::kMillisecond;
using test::kSecond;

// Sensor 0: relative poses (re-anchoring), sensor 1: (v, psi') with calibration states.
struct Sensors {
  Filter filter;
  std::vector<Measurement> events;
  FilterState start;

  Sensors() {
    SensorModel lidar;
    lidar.model = std::make_unique<PlanarRelativePose>(0);
    lidar.clone_slot = 0;
    lidar.reanchor = true;
    lidar.moves = true;
    filter.add_sensor(std::move(lidar));
    SensorModel thermal;
    const OdometryCalibration calibration{.scale = true, .yaw_bias = true};
    thermal.model = std::make_unique<SpeedAndYawRate>(calibration);
    thermal.moves = thermal.scaled = true;
    filter.add_sensor(std::move(thermal));
    start.stamp_ns = 0;
    start.x(kSpeed) = 10.0;
    start.p.diagonal().head<kCoreStates>() << 1e-4, 1e-4, 0.25, 1.0, 1e-5, 0.04, 0.25;
    start.p(kScale, kScale) = 0.01;
    start.p(kThermalYawBias, kThermalYawBias) = 1e-6;

    test::Drive drive({}, 11);
    Pose last = test::planar(drive.state());
    std::int64_t last_stamp = 0;
    Measurement first;
    first.kind = Measurement::Kind::clone;
    first.stamp_ns = 0;
    events.push_back(first);
    for (std::int64_t t = 33 * kMillisecond; t < 4 * kSecond; t += 33 * kMillisecond) {
      drive.advance_to(t);
      const CoreVector& x = drive.state();
      events.push_back(
          test::rates(1, t, 1.05 * x(kSpeed) + 0.3 * drive.noise(), x(kYawRate) + 0.005 * drive.noise(), 0.3, 0.005));
      if (t % (99 * kMillisecond) != 0) continue;
      RelativeMotion motion;
      motion.from_ns = last_stamp;
      motion.to_ns = t;
      Pose noisy = test::planar(x);
      noisy.translation().x() += 0.01 * drive.noise();
      motion.motion = last.inverse() * noisy;
      Measurement m;
      EXPECT_EQ(to_measurement(motion, OdometryConfig{}, 0, m), Conversion::ok);
      events.push_back(m);
      last = noisy;
      last_stamp = t;
    }
    std::sort(events.begin(), events.end(), processed_before);
  }

  FilterState run(const std::vector<Measurement>& order, ReplayConfig config = {}) const {
    ReplayBuffer buffer(filter, config);
    buffer.restart(start);
    for (const Measurement& m : order) EXPECT_NE(buffer.insert(m), ReplayBuffer::Outcome::too_old);
    return buffer.head();
  }
};

void expect_equal(const FilterState& a, const FilterState& b) {
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_LE((a.x - b.x).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LE((a.p - b.p).cwiseAbs().maxCoeff(), 1e-9);
  for (std::size_t i = 0; i < a.sensors.size(); ++i) {
    EXPECT_EQ(a.sensors[i].accepted, b.sensors[i].accepted);
    EXPECT_EQ(a.sensors[i].rejected, b.sensors[i].rejected);
  }
}

TEST(ReplayBuffer, AnyOrderOfArrivalGivesTheSameState) {
  const Sensors sensors;
  const FilterState sorted = sensors.run(sensors.events);
  EXPECT_GT(sorted.sensors[0].accepted, 30u);
  EXPECT_GT(sorted.sensors[1].accepted, 100u);
  EXPECT_EQ(sorted.sensors[0].unanchored, 0u);
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Measurement> shuffled = sensors.events;
    std::shuffle(shuffled.begin(), shuffled.end(), random);
    expect_equal(sensors.run(shuffled), sorted);
  }
  std::vector<Measurement> reversed(sensors.events.rbegin(), sensors.events.rend());
  expect_equal(sensors.run(reversed), sorted);
  expect_equal(sensors.run(reversed, {.events_per_checkpoint = 1}), sorted);
  expect_equal(sensors.run(reversed, {.events_per_checkpoint = 1000}), sorted);
}

TEST(ReplayBuffer, LateOnesWithinTheHistoryOnly) {
  const Sensors sensors;
  ReplayConfig config;
  config.history_s = 1.0;
  ReplayBuffer buffer(sensors.filter, config);
  buffer.restart(sensors.start);
  for (const Measurement& m : sensors.events) buffer.insert(m);
  EXPECT_GT(buffer.horizon_ns(), kSecond);
  EXPECT_LE(buffer.horizon_ns(), buffer.head().stamp_ns - kSecond);
  const FilterState before = buffer.head();
  EXPECT_EQ(buffer.insert(test::rates(1, kSecond, 10, 0, 0.1, 0.1)), ReplayBuffer::Outcome::too_old);
  expect_equal(buffer.head(), before);
  EXPECT_EQ(buffer.insert(test::rates(1, before.stamp_ns - kSecond / 2 + 1, 10, 0, 0.1, 0.1)),
            ReplayBuffer::Outcome::replayed);
  EXPECT_EQ(buffer.insert(test::rates(1, before.stamp_ns - kSecond / 2 + 1, 10, 0, 0.1, 0.1)),
            ReplayBuffer::Outcome::duplicate);
  EXPECT_EQ(buffer.insert(test::rates(1, before.stamp_ns + 1, 10, 0, 0.1, 0.1)), ReplayBuffer::Outcome::applied);
}

TEST(ReplayBuffer, SmallRoomShortensTheHistoryAndNothingElse) {
  const Sensors sensors;
  ReplayConfig config;
  config.capacity = 32;
  config.checkpoints = 4;
  const FilterState small = sensors.run(sensors.events, config);
  expect_equal(small, sensors.run(sensors.events));
  // Two events swapped inside the short history.
  std::vector<Measurement> swapped = sensors.events;
  for (std::size_t i = 1; i + 1 < swapped.size(); i += 3) std::swap(swapped[i], swapped[i + 1]);
  expect_equal(sensors.run(swapped, config), small);
}

TEST(ReplayBuffer, StateAtAnyInstant) {
  const Sensors sensors;
  ReplayBuffer buffer(sensors.filter, {});
  buffer.restart(sensors.start);
  const std::size_t half = sensors.events.size() / 2;
  FilterState middle;
  for (std::size_t i = 0; i < sensors.events.size(); ++i) {
    buffer.insert(sensors.events[i]);
    if (i == half) middle = buffer.head();
  }
  // The next event may share the stamp: take one that is alone.
  std::size_t alone = half;
  while (sensors.events[alone].stamp_ns == sensors.events[alone + 1].stamp_ns) ++alone;
  ReplayBuffer part(sensors.filter, {});
  part.restart(sensors.start);
  for (std::size_t i = 0; i <= alone; ++i) part.insert(sensors.events[i]);
  expect_equal(*buffer.state_at(sensors.events[alone].stamp_ns), part.head());
  const std::optional<FilterState> later = buffer.state_at(buffer.head().stamp_ns + kSecond);
  ASSERT_TRUE(later);
  EXPECT_GT(later->p(kX, kX), buffer.head().p(kX, kX));
  EXPECT_FALSE(buffer.state_at(-1));
  EXPECT_EQ(buffer.events(0, kSecond).size() + buffer.events(kSecond, 10 * kSecond).size() + 1, sensors.events.size());
}

TEST(ReplayBuffer, LongRunsStaySorted) {
  const Sensors sensors;
  ReplayConfig config;
  config.history_s = 0.5;
  config.capacity = 64;
  ReplayBuffer buffer(sensors.filter, config);
  buffer.restart(sensors.start);
  std::mt19937_64 random(2);
  std::int64_t t = 0;
  for (int i = 0; i < 20'000; ++i) {
    t += kMillisecond;
    const std::int64_t late = static_cast<std::int64_t>(random() % 30) * kMillisecond;
    buffer.insert(test::rates(1, t - late + static_cast<std::int64_t>(random() % 1000), 10, 0, 0.3, 0.005));
  }
  EXPECT_TRUE(buffer.head().x.allFinite());
  const auto events = buffer.events(kNoStamp, t + kSecond);
  EXPECT_TRUE(std::is_sorted(events.begin(), events.end(), processed_before));
  EXPECT_GT(events.size(), 20u);
}

}  // namespace
}  // namespace adit::state_estimator
