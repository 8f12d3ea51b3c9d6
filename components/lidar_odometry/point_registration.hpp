// Iterative closest point against a PointMap: the registrations of KISS-ICP and of GenZ-ICP.
#pragma once

#include <span>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/lidar_odometry/point_map.hpp"
#include "components/lidar_odometry/worker_pool.hpp"

namespace adit::lidar_odometry {

struct PointRegistrationConfig {
  bool planar = false;     // GenZ-ICP: point-to-plane where the neighbourhood is planar, blended by their share
  double planarity = 0.2;  // GenZ-ICP: largest l3 / (l1 + l2 + l3) of a plane
  int min_neighbours = 5;  // GenZ-ICP: points needed to try a plane
  int max_iterations = 500;
  double convergence = 1e-4;  // norm of the 6-vector step
};

// A prediction that pulls: information of the right perturbation of `pose`. Zero information: no pull.
struct PosePrior {
  Pose pose = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();
};

struct PointRegistrationResult {
  Pose pose = Pose::Identity();
  bool solvable = true;  // false: no partners or a singular system; the pose is the prediction
  int iterations = 0;
  bool converged = false;
  std::size_t matched = 0;
  std::size_t planar = 0;               // of the matched ones
  double rms_residual = 0.0;            // m, of the coordinates of the residuals, weighted
  Matrix6d hessian = Matrix6d::Zero();  // sum w J^T J (blended in GenZ-ICP) of the right perturbation, without prior
};

class PointRegistration {
 public:
  explicit PointRegistration(const PointRegistrationConfig& config) : config_(config) {}

  // points: sensor frame. max_distance: gate [m]; kernel: scale of the robust weight.
  PointRegistrationResult align(std::span<const Eigen::Vector3d> points, const PointMap& map, const Pose& guess,
                                double max_distance, double kernel, const PosePrior& prior, WorkerPool& pool);

 private:
  static constexpr std::size_t chunk_size = 256;

  // Normal equations of one chunk, kept apart for planar and non-planar residuals.
  struct Sums {
    Matrix6d hessian[2];
    Vector6d gradient[2];
    std::size_t count[2];
    double weight, squared;  // of the residuals' coordinates
    void clear();
    void add(const Sums& other);
  };
  bool fit_plane(const NeighbourhoodStatistics& statistics, Eigen::Vector3d& normal) const;
  void accumulate(std::span<const Eigen::Vector3d> points, const PointMap& map, const Pose& pose, double max_distance,
                  double kernel, Sums& sums) const;

  PointRegistrationConfig config_;
  std::vector<Sums> chunks_;
};

}  // namespace adit::lidar_odometry
