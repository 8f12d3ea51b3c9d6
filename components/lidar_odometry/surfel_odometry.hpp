// Mode default: range-image surfels against a map of averaged planes, with honest priors and directional information.
#pragma once

#include <vector>

#include "components/lidar_odometry/config.hpp"
#include "components/lidar_odometry/pipeline.hpp"
#include "components/lidar_odometry/range_image.hpp"
#include "components/lidar_odometry/surfel.hpp"
#include "components/lidar_odometry/surfel_map.hpp"
#include "components/lidar_odometry/surfel_registration.hpp"

namespace adit::lidar_odometry {

class SurfelOdometry final : public Pipeline {
 public:
  // Precondition: check(config) succeeds.
  SurfelOdometry(const Config& config, WorkerPool& pool);

  void process(const SweepTask& task, Estimate& estimate) override;
  void reset() override;

 private:
  SurfelPrior prior_of(const SweepTask& task) const;
  SweepTwist twist_of(const SweepTask& task) const;
  bool position_known(const SweepTask& task) const;
  void note_twist(const Vector6d& twist, bool sampled, double dt);
  Matrix6d widened(const Matrix6d& match, const Matrix6d& lag, const SweepTask& task) const;
  SurfelRegistrationResult search_start(const SweepTask& task, const SurfelPrior& prior, const SweepTwist& twist,
                                        std::size_t needed, const SurfelRegistrationResult& at_rest);
  void keep_first(const SweepTwist& twist, const Pose& pose, const SweepMotion& sampled);
  SurfelRegistrationResult redo_start(SweepTwist twist, std::size_t needed, SurfelRegistrationResult result);

  Config config_;
  WorkerPool& pool_;
  RangeImage image_;
  SurfelExtractor extractor_;
  SurfelMap map_;
  SurfelRegistration registration_;
  std::vector<Surfel> surfels_;
  int sweeps_ = 0;                             // in the map
  double last_median_ = 0.0;                   // m, residual of the last registration
  std::optional<Vector6d> last_twist_;         // that the last sweep was compensated with
  Vector6d twist_change2_ = Vector6d::Zero();  // mean square of its change from sweep to sweep
  int twist_changes_ = 0;                      // that are in it; 0: it is not known
  // The first sweep of the map, until the second one tells its velocity; motion: within it, if it came from outside.
  struct First {
    std::vector<Surfel> surfels;
    SweepMotion motion;
    SweepTwist sweep;
    Pose pose = Pose::Identity();
  };
  First first_;
  bool redo_first_ = false;  // no sweep has come since
};

}  // namespace adit::lidar_odometry
