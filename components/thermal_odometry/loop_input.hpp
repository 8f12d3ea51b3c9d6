// From frames, clouds and the odometry's poses to keyframes for loop closure: one every few metres, its corners with
// LiDAR depth.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "components/thermal_odometry/camera.hpp"
#include "components/thermal_odometry/cloud_buffer.hpp"
#include "components/thermal_odometry/corners.hpp"
#include "components/thermal_odometry/depth_anchor.hpp"
#include "components/thermal_odometry/frame.hpp"

namespace adit::thermal_odometry {

class LoopInput {
 public:
  struct Config {
    double distance = 2.0;  // m from keyframe to keyframe, or
    double angle = 0.35;    // rad
    CornerConfig corners;
    DepthAnchor::Config anchor;
    std::size_t max_cloud_points = 1U << 17U;
    double max_cloud_age_s = 0.2;
    std::int64_t stamp_tolerance_ns = 16'000'000;  // of a pose and its frame: half a period at 30 Hz
  };
  LoopInput(const CameraModel& camera, const Config& config);

  // Copies. The frame has the calibrated size; others are left out.
  void add_frame(const Frame& frame);
  void add_cloud(const DepthPoints& cloud) { clouds_.add(cloud); }
  // `known`: the motion since the last pose is measured. True if this is a keyframe: its frame is here, and it is far
  // enough from the last one.
  bool add_pose(std::int64_t stamp_ns, const Pose& T_odom_camera, bool known);
  void clear();

  // Of the last keyframe.
  const std::vector<Corner>& corners() const { return corners_; }
  const std::vector<Descriptor>& descriptors() const { return descriptors_; }
  bool known() const { return keyframe_known_; }  // the motion since the keyframe before
  int corners_with_depth() const { return with_depth_; }

 private:
  struct Picture {
    std::int64_t stamp_ns = 0;
    bool used = false;
    std::vector<std::uint16_t> counts;
  };
  const Picture* nearest(std::int64_t stamp_ns) const;

  Config config_;
  int width_;
  int height_;
  Rectifier rectifier_;
  CloudBuffer clouds_;
  DepthAnchor anchor_;
  PoseHistory history_;
  std::int64_t last_stamp_ns_ = 0;
  std::array<Picture, 4> pictures_;  // odometry is a few frames late at most
  std::size_t next_picture_ = 0;
  bool has_keyframe_ = false;
  Pose last_keyframe_ = Pose::Identity();
  bool all_known_ = true;
  bool keyframe_known_ = true;
  int with_depth_ = 0;
  Image raw_;
  Image image_;
  std::vector<Corner> corners_;
  std::vector<Descriptor> descriptors_;
};

}  // namespace adit::thermal_odometry
