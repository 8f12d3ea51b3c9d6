// What the odometry is told beforehand (Prior) and what it answers (Estimate).
// Poses are T_odom_lidar: sensor coordinates to odometry coordinates. Uncertainty is of the right perturbation
// T * se3_exp(xi), xi = [translation; rotation] in the sensor frame, metres and radians.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "components/geometry/trajectory.hpp"

namespace adit::lidar_odometry {

// Prediction of the pose at LidarOdometry::stamps(cloud).reference_ns, e.g. by a filter, wheels or an IMU.
struct Prior {
  enum class Kind {
    increment,  // pose = T_last_now: motion since the instant of the last estimate
    absolute,   // pose = T_odom_now. With the first cloud it sets where the odometry starts.
  };
  Kind kind = Kind::increment;
  Pose pose = Pose::Identity();
  // Of the right perturbation [1/m^2, 1/rad^2]. Zero: only a first guess, the result does not lean on it.
  Matrix6d information = Matrix6d::Zero();
  // Velocity [m/s; rad/s] in the sensor frame during this sweep, for the motion compensation. Nothing: from the pose.
  std::optional<Vector6d> twist;
  // Poses of the sensor during this sweep in any fixed frame, from its first to its last point, e.g. of an IMU, for the
  // motion compensation instead of a twist. Not kept. Poses that do not reach over the sweep are ignored and counted.
  std::span<const StampedPose> sweep;
  // What those poses are wrong by, as a twist in the sensor frame that is constant within the sweep [m/s; rad/s].
  Matrix6d sweep_covariance = Matrix6d::Zero();
};

// Two increments that know of each other nothing, as one: each direction by its information, the sweep of the first.
Prior combined(const Prior& first, const Prior& second);

enum class Status : std::uint8_t {
  initialising,    // the first cloud: it is the map now
  ok,              // registered
  degenerate,      // registered, but some directions are not observed: see localizability
  too_few_points,  // refused: not enough usable points; the pose is the prediction
  bad_stamp,       // refused: stamp not after the last one; the pose is the last one
  bad_cloud,       // refused: fields of unequal size, or width * height is not the size
  lost,            // did not match the map; the pose is the prediction
  restarted,       // lost too often: the local map starts anew here; the pose is the prediction
};
std::string_view to_string(Status status);
// True if the pose comes from a registration (ok, degenerate).
bool registered(Status status);

// How well one direction is observed by the geometry alone.
struct Direction {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  // unit, sensor frame
  double sigma = 0.0;                               // m or rad; infinity: not observed at all
  bool observable = false;                          // sigma is below the required one
};
struct Localizability {
  std::array<Direction, 3> translation;  // weakest first
  std::array<Direction, 3> rotation;     // weakest first
  int unobservable() const;              // directions of the six that are not observable
};

// Of one cloud.
struct ScanCounters {
  std::uint32_t points = 0;         // in the message
  std::uint32_t invalid = 0;        // NaN, Inf, (0,0,0)
  std::uint32_t out_of_range = 0;   // outside ]min_range, max_range[
  std::uint32_t registered = 0;     // points or surfels given to the registration
  std::uint32_t matched = 0;        // of these, with a partner in the map at the end
  std::uint32_t associations = 0;   // times partners were searched
  std::uint32_t solves = 0;         // linear systems solved
  std::uint32_t map_cells = 0;      // occupied cells of the local map
  std::uint32_t evicted_cells = 0;  // dropped because the map was full
  bool iteration_cap = false;       // stopped by the cap, not by convergence
  double rms_residual = 0.0;        // m, of the matched points
  double planar_ratio = 0.0;        // alpha of GenZ-ICP: planar share of the matched points (genz, default)
};

// Since construction or reset().
struct TotalCounters {
  std::uint64_t clouds = 0;
  std::uint64_t registered = 0;
  std::uint64_t degenerate = 0;
  std::uint64_t refused = 0;  // too_few_points, bad_stamp, bad_cloud
  std::uint64_t lost = 0;
  std::uint64_t restarts = 0;
  std::uint64_t bad_priors = 0;  // not finite, not rigid, or not over the sweep: ignored
};

struct Estimate {
  Status status = Status::initialising;
  // The instant the pose refers to, for clouds with point times: the end of the sweep (kiss, default) or its middle
  // (genz, and kiss without deskew). Without point times: the cloud's stamp.
  std::int64_t stamp_ns = 0;
  Pose pose = Pose::Identity();
  // Mean velocity between the last two estimates [m/s; rad/s], sensor frame.
  Vector6d twist = Vector6d::Zero();
  // Of the match of this sweep against the local map: the LiDAR alone, no prior in it (fuse it with the prior without
  // counting the prior twice). Unobserved directions have zero information. Zero unless registered(status).
  Matrix6d information = Matrix6d::Zero();
  // What is left of the slope of its cost at the pose: the match alone would move by -information^-1 gradient; what
  // holds it back is the prior. Right perturbation, as the information.
  Vector6d gradient = Vector6d::Zero();
  // Inverse of the information with unobserved directions limited to 10 m and pi rad. Always positive definite.
  Matrix6d covariance = Matrix6d::Identity();
  Localizability localizability;
  ScanCounters scan;
  TotalCounters total;
};

// A covariance of the right perturbation in the axes of the parent frame, as nav_msgs/Odometry wants it:
// position along, and rotation about, the fixed axes of the frame that `pose` maps to.
Matrix6d covariance_in_parent_axes(const Pose& pose, const Matrix6d& covariance);

}  // namespace adit::lidar_odometry
