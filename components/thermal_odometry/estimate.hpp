// What comes out of a frame.
#pragma once

#include <array>
#include <cstdint>

#include "components/geometry/se3.hpp"
#include "components/thermal_odometry/front_end.hpp"

namespace adit::thermal_odometry {

enum class Status : std::uint8_t {
  initialising,   // no motion known yet
  tracking,       // pose measured from this frame
  frozen,         // repeated picture: nothing measured
  ffc,            // shutter closed by the camera's word: nothing measured
  low_texture,    // fewer usable pixels than a pose needs: nothing measured
  recovering,     // this frame could not be aligned; the next will be tried, and after a few the map restarts
  invalid_frame,  // see verdict
};

enum class ScaleState : std::uint8_t {
  arbitrary,  // the unit of length is the map's own
  carried,    // metric once, no LiDAR support at the newest keyframe: log_scale_sigma grows with the path
  metric,     // anchored by LiDAR depth
};

const char* to_string(Status status);
const char* to_string(Verdict verdict);

struct Counters {
  std::array<std::uint64_t, verdict_count> verdicts{};  // by Verdict
  std::uint64_t tracked = 0;
  std::uint64_t failed = 0;    // frames that could not be aligned
  std::uint64_t restarts = 0;  // maps given up
  std::uint64_t keyframes = 0;
  std::uint64_t scale_corrections = 0;
};

struct Estimate {
  std::int64_t stamp_ns = 0;
  Status status = Status::initialising;
  Verdict verdict = Verdict::good;
  bool measured = false;  // the poses below come from this frame's pixels

  // Camera in the odometry frame (the camera at the first tracked frame). Without measurement: the last known or, while
  // recovering, the predicted pose.
  Pose T_odom_camera = Pose::Identity();

  // Motion since the previous measured frame; valid if both belong to one map (previous_stamp_ns != 0).
  std::int64_t previous_stamp_ns = 0;
  Pose T_previous_camera = Pose::Identity();
  // Of the right increment of T_previous_camera, as of one alignment: photometric noise, without the scale's part,
  // which is log_scale_sigma times the step and the same in every step.
  Matrix6d step_covariance = Matrix6d::Identity();

  // Pose in the reference keyframe with the covariance of its right increment T exp(xi) (camera axes; [translation,
  // rotation]; photometric noise, depth and scale; no prior in it) and the bare photometric information of the same.
  std::int64_t keyframe_stamp_ns = 0;
  Pose T_keyframe_camera = Pose::Identity();
  Matrix6d covariance = Matrix6d::Identity();
  Matrix6d information = Matrix6d::Zero();

  ScaleState scale = ScaleState::arbitrary;
  double log_scale_sigma = 1.0;       // of ln(true / estimated length)
  double log_scale_correction = 0.0;  // applied to the map at this frame when LiDAR came back; else 0

  // Rotation the LiDAR's extrinsics lack, as a vector in camera axes [rad] about the camera, and its covariance.
  Eigen::Vector3d boresight = Eigen::Vector3d::Zero();
  Eigen::Matrix3d boresight_covariance = Eigen::Matrix3d::Zero();

  bool new_keyframe = false;
  int selected = 0;       // pixels chosen at the newest keyframe
  int anchored = 0;       // of them with LiDAR depth
  int points = 0;         // used by the last alignment
  float residual = 0.0F;  // scale of the residuals [noise units]
  float inlier_share = 0.0F;
  float visible_share = 0.0F;
  float correlation = 0.0F;  // between keyframe and frame over the points
  float flow = 0.0F;         // px since the keyframe, median
  float gain = 0.0F;         // ln, relative to the keyframe
  float offset = 0.0F;       // noise units
  float noise_counts = 0.0F;
  Counters counters;
};

}  // namespace adit::thermal_odometry
