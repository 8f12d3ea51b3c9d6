// Compares an estimated trajectory with the truth. Conventions of evo (ATE = APE of the translation part, RPE) and of
// the KITTI odometry devkit (drift by length), so that figures can be set beside published ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bringup/evaluation/alignment.hpp"
#include "components/geometry/trajectory.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

struct Options {
  Alignment alignment = Alignment::first_pose;  // for ATE, the series and the plots
  bool yaw_only = false;                        // restrict every alignment to yaw and translation
  double max_truth_gap_s = 0.5;          // the truth is interpolated between neighbours not further apart than this,
  double max_stamp_difference_s = 0.01;  // else its poses are paired with the estimate's nearest within this
  // A pause of the estimate longer than this counts as not available. 0: three times its median period.
  double max_estimate_gap_s = 0.0;
  // Axial and lateral errors along this line (the tunnel's axis, the route; x, y): along it, and across. Empty: along
  // the truth's heading at each instant, which says little of errors that reach around the next bend.
  std::vector<Eigen::Vector2d> centre_line = {};
  std::vector<double> lengths_m = {1, 5, 10, 20, 50, 100, 200, 300, 400, 500, 600, 700, 800};
};

// A common instant. Poses and errors in the truth's frame, the estimate after alignment.
struct Sample {
  std::int64_t stamp_ns = 0;
  double distance_m = 0.0;  // truth's path from the first common instant
  Pose truth = Pose::Identity();
  Pose estimate = Pose::Identity();
  double position_error_m = 0.0;
  double axial_error_m = 0.0;    // horizontal, along the truth's heading (or the centre line), ahead positive
  double lateral_error_m = 0.0;  // horizontal, left of the truth's heading (or direction of travel) positive
  double yaw_error_rad = 0.0;    // heading of the estimate minus heading of the truth, in (-pi, pi]
  // The same with the first poses aligned, whatever the options say.
  Eigen::Vector3d start_aligned = Eigen::Vector3d::Zero();
  double start_yaw_error_rad = 0.0;
};

struct StampedValue {
  std::int64_t stamp_ns = 0;
  double value = 0.0;
};

// Over all sub-paths of a length: start at every common instant, end at the first one at least `length_m` further on.
struct DriftByLength {
  double length_m = 0.0;
  std::size_t segments = 0;
  double translation_percent = 0.0;  // mean of |relative translation error| / path [%]
  double rotation_deg_per_m = 0.0;   // mean of relative rotation angle / path
  double translation_rmse_m = 0.0;   // evo_rpe's rmse for the same pairs
};

struct Evaluation {
  std::string name;
  std::size_t frames = 0;         // common instants
  double truth_distance_m = 0.0;  // of the whole truth
  double truth_duration_s = 0.0;
  double distance_m = 0.0;  // of the truth between the first and the last common instant
  std::optional<double> ate_rmse_m, ate_mean_m, ate_median_m, ate_max_m;  // after `alignment`
  // From the first common pose on (first-pose alignment whatever `alignment` is):
  std::optional<double> drift_percent;  // position error at the end / distance
  std::optional<double> yaw_end_deg;    // absolute heading error at the end
  std::optional<double> axial_end_m, lateral_end_m;
  std::optional<double> rpe_10m_percent;  // translation_percent of the 10 m row
  std::optional<double> scale;            // factor of the Sim(3) fit: truth = scale * estimate (evo's convention)
  double availability = 0.0;              // share of the truth's duration that the estimate covers without long pauses
  double largest_gap_s = 0.0;             // longest time without a pose within the truth's duration
  double alignment_yaw_rad = 0.0;         // heading of the alignment of the first poses
  // Of the planar pose, where the estimate has a covariance (consistency.hpp).
  std::optional<double> nees_mean;        // 3 when the covariance is right
  std::optional<double> sigma3_coverage;  // share of the samples whose axial error is within 3 sigma
  std::vector<StampedValue> nees;
  std::optional<double> cpu_s;       // processor time of the component that made the estimate
  std::vector<DriftByLength> drift;  // lengths that fit into the distance
  std::vector<Sample> samples;       // in time order
};

// Precondition of both: stamps strictly increase (what read_tum returns). Errors: fewer than two truth poses,
// non-finite or non-increasing input, no common instant, an alignment that is not determined.
Result<Evaluation> evaluate(const Trajectory& truth, const Trajectory& estimate, const Options& options = {});

// The row of an estimator that delivered nothing: availability 0, no figures.
Evaluation nothing_delivered(const std::string& name, const Trajectory& truth);

}  // namespace adit::evaluation
