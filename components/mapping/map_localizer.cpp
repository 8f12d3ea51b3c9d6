#include "components/mapping/map_localizer.hpp"

#include <cmath>

#include "components/pose_graph/pose_graph.hpp"

namespace adit::mapping {

MapLocalizer::MapLocalizer(std::span<const Point> map, const Pose& start, const Config& config)
    : config_(config), coarse_(map, config.coarse_voxel), fine_(map, config.fine_voxel), start_(start) {}

bool MapLocalizer::add(const Sweep& sweep, const Trajectory& odometry) {
  Instant now;
  now.stamp_ns = end_ns(sweep);
  if (!instants_.empty() && now.stamp_ns <= instants_.back().stamp_ns) return false;
  const std::optional<Pose> odom = pose_at(odometry, now.stamp_ns);
  std::size_t invalid = 0;
  if (!odom || !undistort(sweep, odometry, *odom, config_.sweep, cloud_, invalid) || cloud_.empty()) return false;
  now.odom = *odom;
  now.map = instants_.empty() ? start_ : instants_.back().map * (instants_.back().odom.inverse() * now.odom);

  RegistrationConfig config;
  Pose guess = now.map;
  if (instants_.empty()) {
    config.kernel = config_.start_kernel;
    guess = align(cloud_, coarse_, guess, config).pose;
  }
  config.kernel = config_.coarse_kernel;
  guess = align(cloud_, coarse_, guess, config).pose;
  config.kernel = config_.fine_kernel;
  now.registration = align(cloud_, fine_, guess, config);
  const Registration& r = now.registration;
  now.used = r.converged && r.overlap >= config_.least_overlap && r.rms <= config_.most_rms;
  if (now.used) now.map = r.pose;
  instants_.push_back(now);
  return true;
}

MapLocalizer::Result MapLocalizer::smoothed() const {
  using pose_graph::NodeId;
  Result result;
  pose_graph::PoseGraph graph;
  (void)graph.add_node(Pose::Identity());  // the map
  for (std::size_t i = 0; i < instants_.size(); ++i) {
    const Instant& now = instants_[i];
    const pose_graph::Edge edge{.from = 0,
                                .to = static_cast<NodeId>(graph.size()),
                                .T_from_to = now.registration.pose,
                                .information = with_floor(now.registration.information),
                                .kind = pose_graph::EdgeKind::loop};
    (void)graph.add_node(now.map);
    if (i > 0) {
      const Instant& before = instants_[i - 1];
      const Pose motion = before.odom.inverse() * now.odom;
      const double way = motion.translation().norm();
      Vector6d variance;
      variance << Eigen::Vector3d::Constant(std::pow(config_.step_translation, 2) +
                                            std::pow(config_.drift_translation, 2) * way),
          Eigen::Vector3d::Constant(std::pow(config_.step_rotation, 2) + std::pow(config_.drift_rotation, 2) * way);
      const Matrix6d information = variance.cwiseInverse().asDiagonal();
      (void)graph.add_edge({.from = edge.to - 1, .to = edge.to, .T_from_to = motion, .information = information});
    }
    if (!now.used || !graph.add_edge(edge)) continue;
    ++result.registered;
    result.overlap += now.registration.overlap;
    result.rms += now.registration.rms;
  }
  result.switched_off = graph.solve().loops_off;
  if (result.registered > 0) {
    result.overlap /= static_cast<double>(result.registered);
    result.rms /= static_cast<double>(result.registered);
  }
  for (std::size_t i = 0; i < instants_.size(); ++i) {
    result.poses.push_back({instants_[i].stamp_ns, graph.pose(static_cast<NodeId>(i + 1))});
  }
  return result;
}

}  // namespace adit::mapping
