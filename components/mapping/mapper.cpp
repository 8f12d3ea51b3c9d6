#include "components/mapping/mapper.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "components/mapping/loop_detector.hpp"

namespace adit::mapping {
namespace {

using pose_graph::NodeId;

// Besides the drift of the way: what an odometry step has of its own.
constexpr double step_m = 0.005, step_rad = 2e-4;
// After a jump of the odometry nobody knows where it is.
constexpr double lost_m = 100.0, lost_rad = 1.0;
// Keyframes that waited for the graph to know their place, tried again with each new one.
constexpr int retried_at_once = 2;

}  // namespace

struct Mapper::Impl {
  explicit Impl(const Config& given) : config(given), builder(given.keyframes), detector(config, drive) {
    drive.sections = SectionHistory(config.sections);
  }

  void add_keyframe();
  pose_graph::Edge odometry_edge(const Keyframe& from, const Keyframe& to) const;
  bool examine_ready(bool all);
  Outcome examine(NodeId i, bool& moved);
  bool retry_waiting(std::size_t most);
  void take(const std::vector<Closure>& accepted);

  const Config config;
  KeyframeBuilder builder;
  Drive drive;
  LoopDetector detector;
  std::deque<NodeId> queue;    // keyframes whose sections are not ready
  std::deque<NodeId> waiting;  // revisits that were not recognized: tried again when the graph knows more
  double last_attempt_way = -1e9;
  std::vector<Closure> closures;
  std::vector<std::size_t> edges;  // of the closures
  Counters counters;
  Attempt last_attempt;
  Pose map_odom = Pose::Identity();
};

pose_graph::Edge Mapper::Impl::odometry_edge(const Keyframe& from, const Keyframe& to) const {
  const Pose motion = from.odom.inverse() * to.odom;
  const double way = std::max(0.1, to.way - from.way);
  const double m2 = config.drift_translation * config.drift_translation * way + step_m * step_m;
  const double rad2 = config.drift_rotation * config.drift_rotation * way + step_rad * step_rad;
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(m2), Eigen::Vector3d::Constant(rad2);
  if (!to.unobserved.isZero()) {
    const Eigen::Vector3d axis = to.unobserved.normalized();
    covariance.topLeftCorner<3, 3>() += std::pow(config.unobserved_drift * way, 2) * axis * axis.transpose();
  }
  if (to.after_jump) {
    covariance.diagonal() << Eigen::Vector3d::Constant(lost_m * lost_m), Eigen::Vector3d::Constant(lost_rad * lost_rad);
  }
  const Matrix6d information = covariance.inverse();
  const auto id = static_cast<NodeId>(drive.keyframes.size());
  return {.from = id - 1, .to = id, .T_from_to = motion, .information = 0.5 * (information + information.transpose())};
}

void Mapper::Impl::add_keyframe() {
  Keyframe& next = builder.keyframe();
  if (drive.keyframes.size() >= config.max_keyframes) {
    ++counters.keyframes_refused;
    return;
  }
  const Result<NodeId> id = drive.graph.add_node(map_odom * next.odom);
  if (!id) {
    ++counters.keyframes_refused;
    return;
  }
  if (*id > 0) (void)drive.graph.add_edge(odometry_edge(drive.keyframes.back(), next));
  const bool turned = !drive.keyframes.empty() && next.backwards != drive.keyframes.back().backwards;
  if (next.after_jump || turned) drive.sections.begin_run();
  for (const Section& section : builder.sections()) drive.sections.add(section);
  queue.push_back(*id);
  // The builder needs pose and counts of its last keyframe, not its points.
  Points points = std::exchange(next.points, {});
  drive.keyframes.push_back(next);
  drive.keyframes.back().points = std::move(points);
}

void Mapper::Impl::take(const std::vector<Closure>& accepted) {
  for (const Closure& closure : accepted) {
    if (!drive.graph.add_edge(edge_of(closure))) continue;
    edges.push_back(drive.graph.edges().size() - 1);
    closures.push_back(closure);
    ++counters.closures;
    // The place is mapped: one cloud of it is enough.
    drive.keyframes[closure.to].points = {};
  }
  counters.switched_off = drive.graph.solve().loops_off;
  const NodeId last = static_cast<NodeId>(drive.keyframes.size() - 1);
  map_odom = drive.graph.pose(last) * drive.keyframes[last].odom.inverse();
  map_odom.linear() = orthonormalized(map_odom.linear());
}

Outcome Mapper::Impl::examine(NodeId i, bool& moved) {
  using enum Outcome;
  std::vector<Closure> accepted;
  last_attempt = detector.examine(i, accepted);
  const Outcome outcome = last_attempt.outcome;
  counters.attempts += outcome != nowhere_near ? 1 : 0;
  counters.unrecognized += outcome == unrecognized ? 1 : 0;
  counters.not_registered += outcome == not_registered ? 1 : 0;
  counters.disagreed += outcome == disagreed ? 1 : 0;
  if (!accepted.empty()) {
    take(accepted);
    moved = true;
  }
  return outcome;
}

bool Mapper::Impl::examine_ready(bool all) {
  bool moved = false;
  while (!queue.empty()) {
    const NodeId i = queue.front();
    const Keyframe& keyframe = drive.keyframes[i];
    if (!all && keyframe.sections_end > drive.sections.ready()) break;
    queue.pop_front();
    if (keyframe.way - last_attempt_way < config.closure_distance) continue;
    const Outcome outcome = examine(i, moved);
    if (outcome == Outcome::nowhere_near) continue;
    last_attempt_way = keyframe.way;
    if (outcome == Outcome::unrecognized) waiting.push_back(i);
  }
  return moved;
}

bool Mapper::Impl::retry_waiting(std::size_t most) {
  bool moved = false;
  for (std::size_t n = std::min(most, waiting.size()); n > 0; --n) {
    const NodeId i = waiting.front();
    waiting.pop_front();
    --counters.attempts;
    if (examine(i, moved) == Outcome::unrecognized) {
      --counters.unrecognized;
      waiting.push_back(i);
    }
  }
  return moved;
}

Mapper::Mapper(const Config& config) : impl_(std::make_unique<Impl>(config)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

Mapper::Update Mapper::add(const Sweep& sweep, const Trajectory& odometry, const Eigen::Vector3d& unobserved) {
  Update update;
  using Taken = KeyframeBuilder::Outcome;
  const Taken outcome = impl_->builder.add(sweep, odometry, unobserved);
  impl_->counters.invalid_points = impl_->builder.invalid_points();
  update.used = outcome == Taken::taken || outcome == Taken::keyframe;
  ++(update.used ? impl_->counters.sweeps : impl_->counters.refused_sweeps);
  if (outcome != Taken::keyframe) return update;
  update.keyframe = true;
  impl_->add_keyframe();
  update.moved = impl_->examine_ready(false);
  // Only a graph that has closed a loop can know more than before.
  if (!impl_->closures.empty()) update.moved = impl_->retry_waiting(retried_at_once) || update.moved;
  return update;
}

bool Mapper::finish() {
  bool moved = impl_->examine_ready(true);
  if (!impl_->closures.empty()) moved = impl_->retry_waiting(impl_->waiting.size()) || moved;
  return moved;
}

Pose Mapper::map_odom() const {
  return impl_->map_odom;
}

Trajectory Mapper::trajectory() const {
  Trajectory out;
  for (NodeId i = 0; i < impl_->drive.graph.size(); ++i) {
    out.push_back({impl_->drive.keyframes[i].stamp_ns, impl_->drive.graph.pose(i)});
  }
  return out;
}

Trajectory Mapper::odometry() const {
  Trajectory out;
  for (const Keyframe& keyframe : impl_->drive.keyframes) out.push_back({keyframe.stamp_ns, keyframe.odom});
  return out;
}

const std::vector<Closure>& Mapper::closures() const {
  return impl_->closures;
}
const Attempt& Mapper::last_attempt() const {
  return impl_->last_attempt;
}
const pose_graph::PoseGraph& Mapper::graph() const {
  return impl_->drive.graph;
}
const Counters& Mapper::counters() const {
  return impl_->counters;
}

Points Mapper::local_map() const {
  Points points = impl_->builder.local_points();
  const Eigen::Isometry3f motion = impl_->map_odom.cast<float>();
  for (Point& point : points) point.position = motion * point.position;
  return points;
}

Points Mapper::global_map(double voxel) const {
  VoxelGrid grid(voxel);
  for (NodeId i = 0; i < impl_->drive.graph.size(); ++i) {
    const Eigen::Isometry3f motion = impl_->drive.graph.pose(i).cast<float>();
    for (const Point& point : impl_->drive.keyframes[i].points) {
      grid.insert({motion * point.position, point.intensity});
    }
  }
  return grid.points();
}

}  // namespace adit::mapping
