// Registration of surfels against a SurfelMap: pairwise symmetric point-to-plane residuals, averaged over the cells.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "components/lidar_odometry/directional_information.hpp"
#include "components/lidar_odometry/surfel_map.hpp"
#include "components/lidar_odometry/sweep.hpp"
#include "components/lidar_odometry/worker_pool.hpp"

namespace adit::lidar_odometry {

// What is believed of the pose before the match. Information in map axes about the sensor, [translation; rotation].
struct SurfelPrior {
  Pose pose = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();
  // Weak directions of the match follow the prior. False: the match decides alone, for better or worse; for a guess
  // that is known to be wrong by more than the match.
  bool decides_weak_directions = true;
};

// The motion within the sweep, predicted, and how much of the estimated one replaces it at each association: a share
// below one, since the full one feeds back on the pose without damping.
struct SweepTwist {
  std::optional<TimeSpan> times;  // nothing: no compensation
  double reference_time = 0.0;    // s after the stamp
  double dt = 0.0;                // s since the last pose; 0: nothing is learnt from the estimate
  Pose last = Pose::Identity();   // at which the estimated motion begins
  Vector6d predicted = Vector6d::Zero();
  double translation_share = 0.0, rotation_share = 0.0;
};

struct SurfelRegistrationResult {
  Pose pose = Pose::Identity();
  Directions directions;                 // in map axes
  Vector6d gradient = Vector6d::Zero();  // of the match alone, at the result, map axes
  std::size_t matched = 0;
  int associations = 0, solves = 0;
  double median_residual = 0.0;  // m, absolute
  double rms_residual = 0.0;     // m, of the matched, robustly weighted
};

class SurfelRegistration {
 public:
  explicit SurfelRegistration(const SurfelConfig& config) : config_(config), information_(config) {}

  // gate: m, largest residual; fewer matches than min_matches end it at the guess with matched as counted.
  SurfelRegistrationResult align(std::span<const Surfel> surfels, const SurfelMap& map, const Pose& guess,
                                 const SurfelPrior& prior, const SweepTwist& twist, double gate,
                                 std::size_t min_matches, WorkerPool& pool);

  // The surfels of the last align() in map coordinates, at its result and with its motion.
  std::span<const MapSurfel> placed() const { return placed_; }
  // The same for a sweep that was not aligned.
  std::span<const MapSurfel> place(std::span<const Surfel> surfels, const Pose& pose, const SweepTwist& twist);

 private:
  static constexpr std::size_t chunk_size = 256;
  struct Sums {
    Matrix6d hessian;
    Vector6d gradient;
    double weight, squared;
  };

  void compensate(std::span<const Surfel> surfels, const SweepTwist& twist, const Pose& estimate, WorkerPool& pool);
  void associate(const SurfelMap& map, const Pose& pose, double gate, WorkerPool& pool);
  double median_residual();
  void accumulate(const Pose& pose, std::size_t begin, std::size_t end, double kernel, Sums& sums);
  Sums linearise(const Pose& pose, double kernel, WorkerPool& pool);

  SurfelConfig config_;
  DirectionalInformation information_;
  std::vector<Surfel> compensated_;  // sensor frame at the reference time
  struct Match {
    Eigen::Vector3d mean;  // of the cell, map coordinates
    Eigen::Vector3f normal;
    float offset;
    float variance;  // m^2, of the plane; negative: no match
    float residual;
  };
  std::vector<Match> matches_;
  std::vector<Constraint> constraints_;
  std::vector<float> residuals_;
  std::vector<Sums> chunks_;
  std::vector<MapSurfel> placed_;
  double scale_ = 1.0;  // of the residuals against the expected noise
};

}  // namespace adit::lidar_odometry
