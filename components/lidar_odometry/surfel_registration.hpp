// Registration of surfels against a SurfelMap: symmetric point-to-plane residuals (the mean of both normals;
// Rusinkiewicz, "A symmetric objective function for ICP", 2019) with the map's averaged over the cells. They are a sum
// of squares, so that Gauss-Newton descends; the product of the two residuals is not, and where far surfaces bind a
// translation to a rotation its curvature is a small difference of large noisy numbers: steps of decimetres to either
// side.
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

// Of directions that nothing else tells of: 1 m, 0.2 rad. No solution is left open.
inline Vector6d open_information() {
  return (Vector6d() << Eigen::Vector3d::Constant(1.0), Eigen::Vector3d::Constant(25.0)).finished();
}

// The motion within the sweep: predicted, and how much of the estimated one replaces it at each association.
// The estimated translation is that from the middle of the last sweep to the middle of this one. Poses at the ends of
// sweeps would feed back: a wrong velocity displaces them, they make the next velocity wrong, and where the evidence
// lies early in the sweep that recursion does not decay. A wrong velocity leaves the pose at the time of the evidence,
// half a sweep before the end on average, as it is. Rotations, whose evidence is all around, are taken from end to end:
// without delay; not of the first two sweeps, whose twist is one and the same unknown: from end to end its error would
// come back with the other sign each time.
struct SweepTwist {
  std::optional<TimeSpan> times;        // nothing: no compensation
  double reference_time = 0.0;          // s after the stamp
  double dt = 0.0;                      // s since the last sweep; 0: nothing is learnt from the estimate
  Pose last = Pose::Identity();         // at the end of the last sweep
  Pose last_middle = Pose::Identity();  // in its middle
  Vector6d predicted = Vector6d::Zero();
  double translation_share = 0.0, rotation_share = 0.0;
  bool rotation_from_middles = false;
  // The motion from outside, e.g. of an IMU; `predicted` then only has its mean velocity, of which the estimate may
  // correct the translation: by how far the pose is from where that motion led.
  const SweepMotion* sampled = nullptr;
  Pose prediction = Pose::Identity();
  // With it, of the first two sweeps: where that motion leads from middle to middle, in map axes [m]. Their common
  // velocity is open, and poses at the ends would feed back.
  std::optional<Eigen::Vector3d> expected_way;

  // The motion that compensates for a twist.
  SweepMotion motion(const Vector6d& twist) const;
  // The pose in the middle of a sweep that ends at `pose` and moves with `twist`.
  Pose middle(const Pose& pose, const Vector6d& twist) const;
  // The twist to compensate with, by a pose that was found with `used`.
  Vector6d refined(const Pose& pose, const Vector6d& used) const;
};

struct SurfelRegistrationResult {
  Pose pose = Pose::Identity();
  Vector6d twist = Vector6d::Zero();     // that the sweep was compensated with
  Directions directions;                 // in map axes
  Vector6d gradient = Vector6d::Zero();  // of the match alone, at the result, map axes
  // s: what a twist that the sweep was wrongly compensated with displaces the match by, in map axes. About half a
  // sweep.
  Matrix6d lag = Matrix6d::Zero();
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
                                 const SurfelPrior& prior, const SweepTwist& sweep, double gate,
                                 std::size_t min_matches, WorkerPool& pool);

  // The surfels of the last align() in map coordinates, at its result and with its motion.
  std::span<const MapSurfel> placed() const { return placed_; }
  // The same for a sweep that was not aligned.
  std::span<const MapSurfel> place(std::span<const Surfel> surfels, const Pose& pose, const SweepTwist& sweep,
                                   const Vector6d& twist);

 private:
  static constexpr std::size_t chunk_size = 256;
  struct Sums {
    Matrix6d hessian;
    Vector6d gradient;
    double weight, squared;
  };

  void compensate(std::span<const Surfel> surfels, const SweepTwist& sweep, const Vector6d& twist, WorkerPool& pool);
  void place(const Pose& pose);
  void associate(const SurfelMap& map, const Pose& pose, double gate, WorkerPool& pool);
  double median_residual();
  void accumulate(const Pose& pose, std::size_t begin, std::size_t end, double kernel, Sums& sums);
  Sums linearise(const Pose& pose, double kernel, WorkerPool& pool);
  Matrix6d lag(const Matrix6d& hessian) const;

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
  double scale_ = 1.0;           // of the residuals against the expected noise
  double reference_time_ = 0.0;  // s after the stamp: the instant of the pose
};

}  // namespace adit::lidar_odometry
