// From sweeps with odometry to keyframes: a pose every few metres with the points around it, and the sections of the
// way between.
#pragma once

#include <optional>
#include <vector>

#include "components/mapping/cloud.hpp"
#include "components/mapping/section.hpp"
#include "components/mapping/voxel_grid.hpp"

namespace adit::mapping {

struct Keyframe {
  std::int64_t stamp_ns = 0;
  Pose odom = Pose::Identity();  // T_odom_sensor
  double way = 0.0;              // m driven since the first one
  std::size_t sections_end = 0;  // sections of the history up to here
  bool backwards = false;        // the sensor looked back on the way to here: its sections look the other way
  // Around it, in its frame, one a voxel: of all sweeps since they came near. Empty: another keyframe's serve.
  Points points;
  // Axis [sensor frame] along which the odometry saw nothing on the way here; zero: none.
  Eigen::Vector3d unobserved = Eigen::Vector3d::Zero();
  bool after_jump = false;  // the odometry did not get here as a body moves: restarted
};

// T_keyframe_section's turn: axes that look along the way it was driven, in those of the keyframe.
Pose along_the_way(const Keyframe& keyframe);

class KeyframeBuilder {
 public:
  struct Config {
    double distance = 4.0;        // m between keyframes
    double angle = 0.6;           // rad, the same
    double local_voxel = 0.2;     // m, of the local map
    double local_radius = 40.0;   // m
    double voxel = 0.3;           // m, of what a keyframe keeps
    double radius = 20.0;         // m
    double section_reach = 12.0;  // m from the way to the wall
    double max_speed = 80.0;      // m/s: faster is a jump of the odometry
    Undistortion sweep;
  };
  KeyframeBuilder() : KeyframeBuilder(Config()) {}
  explicit KeyframeBuilder(const Config& config) : config_(config), local_(config.local_voxel) {}

  enum class Outcome { taken, keyframe, no_poses, no_points, bad_stamp };
  // `odometry`: T_odom_sensor, covering the sweep. With `keyframe` it is in `keyframe()`, its sections in `sections()`.
  Outcome add(const Sweep& sweep, const Trajectory& odometry,
              const Eigen::Vector3d& unobserved = Eigen::Vector3d::Zero());

  Keyframe& keyframe() { return keyframe_; }
  const std::vector<Section>& sections() const { return sections_; }
  // The local map, in odom.
  Points local_points() const { return local_.points(); }
  std::size_t invalid_points() const { return invalid_; }

 private:
  void make_keyframe(const StampedPose& now);

  Config config_;
  VoxelGrid local_;
  Points sweep_;
  std::optional<StampedPose> last_sweep_;
  bool any_keyframe_ = false;
  bool jumped_ = false;
  Eigen::Vector3d unobserved_ = Eigen::Vector3d::Zero();
  Keyframe keyframe_;
  std::vector<Section> sections_;
  std::size_t invalid_ = 0;
};

}  // namespace adit::mapping
