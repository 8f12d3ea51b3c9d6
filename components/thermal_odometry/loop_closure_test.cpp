#include "components/thermal_odometry/loop_closure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "components/thermal_odometry/test_scene.hpp"

namespace adit::thermal_odometry {
namespace {

std::vector<Descriptor> random_descriptors(std::mt19937_64& random, int count) {
  std::vector<Descriptor> out(static_cast<std::size_t>(count));
  for (Descriptor& descriptor : out) {
    for (std::uint64_t& word : descriptor) word = random();
  }
  return out;
}

TEST(PlaceIndex, FindsAPlaceAmongFiveHundredThroughNoise) {
  std::mt19937_64 random(1);
  PlaceIndex index;
  std::vector<std::vector<Descriptor>> places;
  for (int p = 0; p < 500; ++p) index.add(places.emplace_back(random_descriptors(random, 200)));
  int found = 0;
  for (std::uint32_t p = 0; p < 500; p += 10) {
    std::vector<Descriptor> seen = places[p];
    for (Descriptor& descriptor : seen) {
      for (int flips = 0; flips < 25; ++flips) descriptor[random() % 4] ^= std::uint64_t{1} << random() % 64;
    }
    const auto votes = index.query(seen, 500, 2);
    // Random descriptors differ in 128 bits: no other place gets a vote.
    found += votes.size() == 1 && votes[0].place == p && votes[0].count > 150 ? 1 : 0;
  }
  EXPECT_EQ(found, 50);
  EXPECT_TRUE(index.query(places[7], 7, 1).empty() || index.query(places[7], 7, 1)[0].place < 7);
  EXPECT_TRUE(index.query({}, 500, 3).empty());
}

// A drive with the poses an odometry that drifts would give, and what loop closure makes of it.
class LoopDrive {
 public:
  LoopDrive(TestScene& scene, const LoopClosure::Config& config)
      : scene_(scene), loops_(pinhole_of(scene.camera), config) {}

  // Forward speed along the corridor [m] from keyframe to keyframe; the odometry is too long by `scale` and turns by
  // `yaw` [rad] a metre.
  void drive(int keyframes, double step, double scale, double yaw) {
    for (int i = 0; i < keyframes; ++i) {
      at_ += step;
      ++made_;
      Pose truth = TestScene::drive(0.3 * made_, 0.0);  // sways, never the same way twice
      truth.translation().z() = at_;
      if (!truths_.empty()) {
        Pose motion = truths_.back().inverse() * truth;
        motion.translation() *= 1.0 + scale;
        motion.linear() = motion.linear() * so3_exp(Eigen::Vector3d(0, yaw * std::abs(step), 0));
        odometry_ = odometry_ * motion;
      } else {
        odometry_ = truth;
      }
      truths_.push_back(truth);
      odometries_.push_back(odometry_);
      std::vector<Corner> corners;
      std::vector<Descriptor> descriptors;
      detect_corners(picture(truth), {}, corners, descriptors);
      for (Corner& corner : corners) {
        corner.depth = static_cast<float>(scene_.depth(truth, corner.u, corner.v));
        if (corner.depth > 40.0F) corner.depth = 0.0F;  // what a LiDAR reaches
      }
      outcomes_.push_back(loops_.add(odometry_, true, corners, descriptors));
    }
  }

  // RMS of the positions, m.
  double error_before() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < truths_.size(); ++i)
      sum += (odometries_[i].translation() - truths_[i].translation()).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truths_.size()));
  }
  double error_after() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < truths_.size(); ++i) {
      const Pose& pose = loops_.graph().pose(static_cast<pose_graph::NodeId>(i));
      sum += (pose.translation() - truths_[i].translation()).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(truths_.size()));
  }
  // Of the closures: the worst edge against the truth, m and rad.
  std::pair<double, double> worst_edge() const {
    double metres = 0.0, radians = 0.0;
    for (const auto& outcome : outcomes_) {
      if (outcome.result != LoopClosure::Result::closed) continue;
      const Pose truth = truths_[outcome.from].inverse() * truths_[outcome.node];
      metres = std::max(metres, (outcome.edge.T_from_to.translation() - truth.translation()).norm());
      radians = std::max(radians, so3_log(outcome.edge.T_from_to.linear().transpose() * truth.linear()).norm());
    }
    return {metres, radians};
  }
  const LoopClosure& loops() const { return loops_; }
  void show(const char* name) const {
    using R = LoopClosure::Result;
    const auto [metres, radians] = worst_edge();
    std::printf(
        "%s: %zu keyframes, new %d, out of reach %d, not verified %d, refused %d, closed %d; worst edge %.3f m %.2f "
        "deg; ATE %.3f -> %.3f m\n",
        name, truths_.size(), loops_.count(R::new_place), loops_.count(R::out_of_reach), loops_.count(R::not_verified),
        loops_.count(R::refused), loops_.count(R::closed), metres, radians * 180.0 / M_PI, error_before(),
        error_after());
  }

 private:
  Image picture(const Pose& truth) {
    const Frame frame = scene_.render(truth, 0);
    Image image;
    image.width = frame.width;
    image.height = frame.height;
    image.pixels.assign(frame.data, frame.data + static_cast<std::ptrdiff_t>(frame.width) * frame.height);
    return image;
  }

  TestScene& scene_;
  LoopClosure loops_;
  double at_ = 0.0;
  int made_ = 0;
  Pose odometry_ = Pose::Identity();
  std::vector<Pose> truths_, odometries_;
  std::vector<LoopClosure::Outcome> outcomes_;
};

using Result = LoopClosure::Result;

TEST(LoopClosure, TheSecondLapIsFoundAndHalvesTheError) {
  TestScene scene;
  LoopDrive drive(scene, {});
  drive.drive(30, 1.0, 0.006, 0.0006);   // 30 m out
  drive.drive(15, -2.0, 0.006, 0.0006);  // back in reverse
  const int first_lap = drive.loops().count(Result::closed);
  drive.drive(20, 1.3, 0.006, 0.0006);  // and again
  drive.show("two laps");
  EXPECT_GE(first_lap, 5);
  EXPECT_GE(drive.loops().count(Result::closed), 15);
  EXPECT_LT(drive.worst_edge().first, 0.15);
  EXPECT_LT(drive.worst_edge().second, 0.5 * M_PI / 180.0);
  EXPECT_LT(drive.error_after(), 0.5 * drive.error_before());
}

TEST(LoopClosure, APlaceMetAgainIsNotStoredAgainAndAFullMapStaysAsItIs) {
  TestScene scene;
  LoopDrive drive(scene, {.max_keyframes = 30});
  drive.drive(18, 1.5, 0.006, 0.0006);
  drive.drive(20, -1.5, 0.006, 0.0006);
  const LoopClosure& loops = drive.loops();
  EXPECT_EQ(loops.graph().size(), 30U);
  EXPECT_EQ(loops.count(Result::full), 8);
  EXPECT_GT(loops.count(Result::closed), 3);
  EXPECT_EQ(loops.places(), 30U - static_cast<std::size_t>(loops.count(Result::closed)));
  EXPECT_FALSE(loops.T_map_odom().isApprox(Pose::Identity()));
}

TEST(LoopClosure, NewPlacesAreNotMistakenForOldOnes) {
  TestScene scene;
  LoopDrive drive(scene, {.gate = false});
  drive.drive(60, 1.5, 0.006, 0.0006);
  drive.show("90 m ahead, no gate");
  EXPECT_EQ(drive.loops().count(Result::closed), 0);
  EXPECT_TRUE(drive.loops().T_map_odom().isApprox(Pose::Identity()));
}

// The same walls every 20 m: nothing in the pictures tells the places apart.
TEST(LoopClosure, ATunnelThatRepeatsItselfIsRefusedByTheGate) {
  TestScene scene;
  scene.repeats_every = 20.0;
  LoopDrive trusting(scene, {.gate = false});
  trusting.drive(40, 1.5, 0.006, 0.0006);
  trusting.show("aliases, no gate");
  EXPECT_GT(trusting.loops().count(Result::closed), 15);  // the trap works

  TestScene again;
  again.repeats_every = 20.0;
  LoopDrive drive(again, {});
  drive.drive(40, 1.5, 0.006, 0.0006);
  drive.show("aliases, gate");
  EXPECT_EQ(drive.loops().count(Result::closed), 0);
  EXPECT_GT(drive.loops().count(Result::out_of_reach) + drive.loops().count(Result::refused), 15);
  EXPECT_EQ(drive.error_after(), drive.error_before());

  // So near that the pictures are compared: the motion they suggest is what is refused then.
  TestScene near;
  near.repeats_every = 10.0;
  LoopDrive close_by(near, {.min_path = 8.0});
  close_by.drive(20, 1.25, 0.006, 0.0006);
  close_by.show("aliases within reach, gate");
  EXPECT_EQ(close_by.loops().count(Result::closed), 0);
  EXPECT_GT(close_by.loops().count(Result::refused), 5);
}

TEST(LoopClosure, IsTheSameFromRunToRun) {
  std::array<Pose, 2> corrections;
  for (Pose& correction : corrections) {
    TestScene scene;
    LoopDrive drive(scene, {});
    drive.drive(12, 1.5, 0.006, 0.0006);
    drive.drive(9, -2.0, 0.006, 0.0006);
    EXPECT_GT(drive.loops().count(Result::closed), 0);
    correction = drive.loops().T_map_odom();
  }
  EXPECT_TRUE((corrections[0].matrix().array() == corrections[1].matrix().array()).all());
}

TEST(LoopClosure, BadInputIsSurvived) {
  LoopClosure loops(pinhole_of(TestScene().camera), {.min_path = 0.0, .min_votes = 1, .gate = false});
  std::mt19937_64 random(2);
  Image image;
  image.width = 320;
  image.height = 256;
  image.pixels.assign(320 * 256, 7.0F);
  std::vector<Corner> corners;
  std::vector<Descriptor> descriptors;
  detect_corners(image, {}, corners, descriptors);
  EXPECT_TRUE(corners.empty());
  loops.add(Pose::Identity(), true, corners, descriptors);
  image.pixels[100] = std::nanf("");
  detect_corners(image, {}, corners, descriptors);
  EXPECT_TRUE(corners.empty());
  image.width = image.height = 5;
  detect_corners(image, {}, corners, descriptors);
  EXPECT_TRUE(corners.empty());
  Pose broken = Pose::Identity();
  broken.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(loops.add(broken, true, corners, descriptors).result, Result::new_place);
  // The same descriptors over and over, corners anywhere, depths of any kind.
  descriptors = random_descriptors(random, 50);
  corners.resize(50);
  for (int round = 0; round < 20; ++round) {
    for (Corner& corner : corners) {
      corner = {static_cast<float>(random() % 320), static_cast<float>(random() % 256),
                round % 4 == 0 ? std::nanf("") : static_cast<float>(random() % 100) - 20.0F};
    }
    Pose pose = Pose::Identity();
    pose.translation().z() = round;
    EXPECT_NE(loops.add(pose, round % 3 != 0, corners, descriptors).result, Result::closed);
    ASSERT_TRUE(loops.T_map_odom().matrix().allFinite());
  }
  loops.add(Pose::Identity(), true, corners, std::span(descriptors).first(10));  // sizes that do not agree
}

}  // namespace
}  // namespace adit::thermal_odometry
