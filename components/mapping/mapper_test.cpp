// Laps through generated tunnels: what is closed, and what must not be.
#include "components/mapping/mapper.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "components/mapping/test_tunnel.hpp"

namespace adit::mapping {
namespace {

constexpr double step = 2.0;  // m between sweeps, 0.1 s

// Drives a way and maps it; the odometry drifts by a constant turn and a scale.
struct Drive {
  Mapper mapper;
  Trajectory odometry;
  std::vector<Pose> truth;      // of all sweeps
  std::vector<Pose> keyframes;  // truth of the keyframes
  double yaw_a_metre = 6e-5;    // rad
  double scale = 1.002;

  explicit Drive(const Config& config = {}) : mapper(config) {}

  void add(const TestTunnel& tunnel, double s, bool backwards = false) {
    Pose pose = tunnel.at(s);
    if (backwards) pose.linear() = pose.linear() * so3_exp({0.0, 0.0, std::numbers::pi});
    const std::int64_t stamp = static_cast<std::int64_t>(truth.size()) * 100'000'000;
    if (truth.empty()) {
      odometry.push_back({stamp, pose});
    } else {
      Pose motion = truth.back().inverse() * pose;
      motion.translation() *= scale;
      motion.linear() = motion.linear() * so3_exp({0.0, 0.0, yaw_a_metre * motion.translation().norm()});
      odometry.push_back({stamp, odometry.back().pose * motion});
    }
    const Points points = tunnel.seen_from(pose, s, 5'000, static_cast<std::uint32_t>(truth.size()) + 1);
    truth.push_back(pose);
    const Mapper::Update update = mapper.add({stamp, points, {}}, odometry);
    EXPECT_TRUE(update.used);
    if (update.keyframe) keyframes.push_back(pose);
  }
  void lap(const TestTunnel& tunnel, double laps) {
    const double begin = static_cast<double>(truth.size()) * step;
    for (double s = begin; s < begin + laps * tunnel.lap; s += step) add(tunnel, s);
  }

  double worst_closure() const {
    double worst = 0.0;
    for (const Closure& c : mapper.closures()) {
      const Pose error = (keyframes[c.from].inverse() * keyframes[c.to]).inverse() * c.registration.pose;
      worst = std::max(worst, error.translation().norm());
    }
    return worst;
  }
  // Largest distance of a keyframe from its true place; the first one is at its true pose.
  static double worst(const Trajectory& poses, const std::vector<Pose>& truth) {
    double worst = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      worst = std::max(worst, (poses[i].pose.translation() - truth[i].translation()).norm());
    }
    return worst;
  }
};

TEST(Mapper, TwoLapsAreClosedAndTheMapIsStraightened) {
  const TestTunnel tunnel;
  Drive drive;
  drive.lap(tunnel, 2.0);
  drive.mapper.finish();
  const Counters& counters = drive.mapper.counters();
  EXPECT_GE(counters.closures, 24u);  // a lap of 240 m, every 8 m
  EXPECT_LT(drive.worst_closure(), 0.2);
  EXPECT_EQ(counters.switched_off, 0u);
  const double before = Drive::worst(drive.mapper.odometry(), drive.keyframes);
  const double after = Drive::worst(drive.mapper.trajectory(), drive.keyframes);
  EXPECT_GT(before, 0.7);
  EXPECT_LT(after, 0.5 * before);
  // map_odom takes the present pose near to where the place was mapped first.
  const Pose corrected = drive.mapper.map_odom() * drive.odometry.back().pose;
  EXPECT_LT((corrected.translation() - drive.truth.back().translation()).norm(), 0.3 * before);
  // One cloud a place: the second lap added nothing.
  EXPECT_LT(drive.mapper.global_map(0.3).size(), 240.0 * 25.0 / 0.09 * 2.0);
}

TEST(Mapper, AWayDrivenBackInReverseIsClosed) {
  const TestTunnel tunnel;
  Drive drive;
  for (double s = 0.0; s <= 160.0; s += step) drive.add(tunnel, s);
  for (double s = 160.0 - step; s >= 0.0; s -= step) drive.add(tunnel, s);
  drive.mapper.finish();
  EXPECT_GE(drive.mapper.counters().closures, 10u);
  EXPECT_LT(drive.worst_closure(), 0.2);
}

TEST(Mapper, ATubeThatLooksLikeAnotherIsNotTakenForIt) {
  // The second lap is through another tube of the same shape, 25 m away; the drift's model makes the first one
  // possible. Two pairs of tubes.
  Config config;
  config.drift_translation = 0.3;
  config.drift_rotation = 0.002;
  for (std::uint32_t seed = 1; seed <= 2; ++seed) {
    TestTunnel first, second;
    first.lap = second.lap = 160.0;
    first.seed = seed;
    second.seed = seed + 1000;
    second.origin.y() = 25.0;
    Drive drive(config);
    for (double s = 0.0; s < 160.0; s += step) drive.add(first, s);
    for (double s = 0.0; s < 160.0; s += step) drive.add(second, s);
    drive.mapper.finish();
    EXPECT_EQ(drive.mapper.counters().closures, 0u) << seed;
    EXPECT_GT(drive.mapper.counters().attempts, 5u) << seed;
  }
}

TEST(Mapper, RepeatingFeaturesDoNotMakeAFalseClosure) {
  TestTunnel tunnel;
  tunnel.period = 20.0;
  Config config;
  config.drift_translation = 0.5;  // the next period is possible
  Drive drive(config);
  drive.scale = 1.02;
  drive.lap(tunnel, 2.0);
  drive.mapper.finish();
  EXPECT_LT(drive.worst_closure(), 0.5);
}

TEST(Mapper, ABareTubeIsNotClosed) {
  TestTunnel tunnel;
  tunnel.depth = tunnel.paint = 0.0;
  Config config;
  config.drift_translation = 0.1;
  Drive drive(config);
  drive.lap(tunnel, 1.5);
  drive.mapper.finish();
  EXPECT_EQ(drive.mapper.counters().closures, 0u);
}

TEST(Mapper, TheWayBackIsRecognized) {
  const TestTunnel tunnel;
  Drive drive;
  for (double s = 0.0; s < 200.0; s += step) drive.add(tunnel, s);
  for (double s = 200.0; s > 0.0; s -= step) drive.add(tunnel, s, true);
  drive.mapper.finish();
  EXPECT_GE(drive.mapper.counters().closures, 8u);
  EXPECT_LT(drive.worst_closure(), 0.2);
}

TEST(Mapper, BadSweepsAreCountedAndLeftOut) {
  const TestTunnel tunnel;
  const Points good = tunnel.seen_from(tunnel.at(0.0), 0.0, 2'000, 1);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Points bad = good;
  for (Point& point : bad) point.position.x() = nan;
  const Trajectory odometry{{0, Pose::Identity()}, {1'000'000'000, Pose(Eigen::Translation3d(5, 0, 0))}};
  Mapper mapper;
  EXPECT_FALSE(mapper.add({0, {}, {}}, odometry).used);
  EXPECT_FALSE(mapper.add({0, bad, {}}, odometry).used);
  EXPECT_FALSE(mapper.add({2'000'000'000, good, {}}, odometry).used);  // no odometry there
  EXPECT_FALSE(mapper.add({0, good, {}}, {}).used);
  EXPECT_TRUE(mapper.add({500'000'000, good, {}}, odometry).keyframe);
  EXPECT_FALSE(mapper.add({400'000'000, good, {}}, odometry).used);  // stamps back
  const std::vector<float> times{0.1F};
  EXPECT_FALSE(mapper.add({600'000'000, good, times}, odometry).used);
  EXPECT_EQ(mapper.counters().refused_sweeps, 6u);
  EXPECT_EQ(mapper.counters().invalid_points, bad.size());
  EXPECT_FALSE(mapper.finish());
  EXPECT_TRUE(mapper.map_odom().matrix().allFinite());
  EXPECT_FALSE(mapper.global_map(0.3).empty());
  EXPECT_TRUE(Mapper().global_map(0.3).empty());
}

TEST(Mapper, AJumpOfTheOdometryIsMendedByTheNextClosure) {
  const TestTunnel tunnel;
  Drive drive;
  drive.lap(tunnel, 1.2);
  const std::size_t closed = drive.mapper.closures().size();
  // The odometry restarts at its origin; the drive goes on.
  drive.odometry.push_back(drive.odometry.back());
  drive.odometry.back().pose = Pose::Identity();
  drive.odometry.back().stamp_ns += 1;
  drive.lap(tunnel, 0.6);
  drive.mapper.finish();
  EXPECT_GT(drive.mapper.closures().size(), closed);
  EXPECT_LT(drive.worst_closure(), 0.3);
  EXPECT_LT(Drive::worst(drive.mapper.trajectory(), drive.keyframes), 3.0);
}

TEST(Mapper, MemoryIsBounded) {
  Config config;
  config.max_keyframes = 10;
  Drive drive(config);
  drive.lap(TestTunnel{}, 0.3);
  EXPECT_EQ(drive.mapper.graph().size(), 10u);
  EXPECT_GT(drive.mapper.counters().keyframes_refused, 0u);
}

TEST(Mapper, TheSameDriveGivesTheSameBytes) {
  const auto poses = [] {
    TestTunnel tunnel;
    tunnel.lap = 200.0;
    Drive drive;
    drive.lap(tunnel, 1.5);
    drive.mapper.finish();
    std::vector<double> numbers;
    for (const StampedPose& pose : drive.mapper.trajectory()) {
      numbers.insert(numbers.end(), pose.pose.data(), pose.pose.data() + 16);
    }
    return numbers;
  };
  const std::vector<double> first = poses(), second = poses();
  ASSERT_EQ(first.size(), second.size());
  EXPECT_EQ(std::memcmp(first.data(), second.data(), first.size() * sizeof(double)), 0);
}

}  // namespace
}  // namespace adit::mapping
