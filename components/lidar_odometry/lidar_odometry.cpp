#include "components/lidar_odometry/lidar_odometry.hpp"

#include <cmath>

#include "components/geometry/rigid.hpp"
#include "components/geometry/stamp_order.hpp"
#include "components/lidar_odometry/localizability.hpp"
#include "components/lidar_odometry/point_odometry.hpp"
#include "components/lidar_odometry/surfel_odometry.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr double ns = 1e-9;
// Clouds with stamps that go on from each other before a clock that was set back is believed.
constexpr int stamps_to_believe = 3;

bool usable(const Prior& prior) {
  return is_rigid(prior.pose) && prior.information.allFinite() && prior.sweep_covariance.allFinite() &&
         (!prior.twist || prior.twist->allFinite());
}

std::unique_ptr<Pipeline> make_pipeline(const Config& config, WorkerPool& pool) {
  if (config.mode == Mode::default_) return std::make_unique<SurfelOdometry>(config, pool);
  return std::make_unique<PointOdometry>(config, pool);
}

}  // namespace

struct LidarOdometry::Impl {
  explicit Impl(const Config& c)
      : config(c), pool(c.threads), pipeline(make_pipeline(c, pool)), order(stamps_to_believe, c.max_gap_s) {}

  // The local map's frame starts at the first pose; the odometry frame is where an absolute prior puts it.
  Config config;
  WorkerPool pool;
  std::unique_ptr<Pipeline> pipeline;
  Estimate estimate;
  bool started = false;
  Pose odom_map = Pose::Identity();
  Pose map_sensor = Pose::Identity();
  Vector6d twist = Vector6d::Zero();
  bool twist_known = false;  // from two registered sweeps
  int lost_in_a_row = 0;
  StampOrder order;  // set back by less than a pause that keeps the map: clouds that overtook each other

  double reference_time(const std::optional<TimeSpan>& times) const;
  void finish();
  void process(const Cloud& cloud, const Prior* prior);
};

double LidarOdometry::Impl::reference_time(const std::optional<TimeSpan>& times) const {
  if (!times) return 0.0;
  const bool end = config.deskew && config.mode != Mode::genz;
  return end ? times->last : 0.5 * (times->first + times->last);
}

void LidarOdometry::Impl::process(const Cloud& cloud, const Prior* prior) {
  ++estimate.total.clouds;
  estimate.scan = {};
  estimate.scan.points = static_cast<std::uint32_t>(cloud.points.size());
  estimate.information.setZero();
  estimate.gradient.setZero();
  estimate.localizability = {};
  if (!consistent(cloud)) {
    estimate.status = Status::bad_cloud;
    ++estimate.total.refused;
    return finish();
  }
  SweepTask task{.cloud = cloud};
  task.times = time_span(cloud);
  task.reference_time = reference_time(task.times);
  const std::int64_t stamp_ns = cloud.stamp_ns + std::llround(task.reference_time / ns);
  if (!order.accepts(stamp_ns, started ? std::optional(estimate.stamp_ns) : std::nullopt)) {
    estimate.status = Status::bad_stamp;
    ++estimate.total.refused;
    return finish();
  }

  task.dt = started && stamp_ns > estimate.stamp_ns ? ns * static_cast<double>(stamp_ns - estimate.stamp_ns) : 0.0;
  if (prior != nullptr && !usable(*prior)) {
    ++estimate.total.bad_priors;
    prior = nullptr;
  }
  if (!started && prior != nullptr && prior->kind == Prior::Kind::absolute) {
    odom_map = prior->pose;
    odom_map.linear() = orthonormalized(odom_map.linear());
  }
  task.last = map_sensor;
  task.prediction = map_sensor;
  const bool coasting = task.dt > 0.0 && task.dt <= config.max_gap_s;
  if (coasting) {
    task.twist = twist;
    task.prediction = map_sensor * se3_exp(task.dt * twist);
    if (twist_known) task.coasting = task.prediction;
  }
  if (started && prior != nullptr) {
    task.external = true;
    task.information = prior->information;
    task.prediction =
        prior->kind == Prior::Kind::absolute ? odom_map.inverse() * prior->pose : map_sensor * prior->pose;
    if (coasting) task.twist = se3_log(map_sensor.inverse() * task.prediction) / task.dt;
  }
  if (prior != nullptr && prior->twist) {
    task.twist = *prior->twist;
    task.external_twist = true;
  }
  if (prior != nullptr && !prior->sweep.empty() && config.deskew && task.times) {
    if (follows(prior->sweep, cloud.stamp_ns, *task.times)) {
      task.sampled = SweepMotion(prior->sweep, cloud.stamp_ns, *task.times, task.reference_time);
      task.sampled_covariance = prior->sweep_covariance;
    } else {
      ++estimate.total.bad_priors;
    }
  }
  task.prediction.linear() = orthonormalized(task.prediction.linear());

  pipeline->process(task, estimate);
  const bool placed = registered(estimate.status) || estimate.status == Status::initialising;
  if (registered(estimate.status)) {
    ++estimate.total.registered;
    if (estimate.status == Status::degenerate) ++estimate.total.degenerate;
  } else if (estimate.status == Status::too_few_points) {
    ++estimate.total.refused;
    if (!started) return finish();
  }
  lost_in_a_row = placed || estimate.status == Status::too_few_points ? 0 : lost_in_a_row + 1;
  if (estimate.status == Status::lost) {
    ++estimate.total.lost;
    if (lost_in_a_row >= config.restart_after) {
      pipeline->reset();
      pipeline->process(task, estimate);
      estimate.status = Status::restarted;
      ++estimate.total.restarts;
      lost_in_a_row = 0;
    }
  }
  if (task.dt > 0.0 && registered(estimate.status)) {
    twist = se3_log(map_sensor.inverse() * estimate.pose) / task.dt;
    twist_known = true;
  } else if (!coasting) {
    twist.setZero();
    twist_known = false;
  }
  map_sensor = estimate.pose;
  estimate.stamp_ns = stamp_ns;
  started = true;
  finish();
}

// From the local map's frame to the caller's.
void LidarOdometry::Impl::finish() {
  estimate.pose = odom_map * map_sensor;
  estimate.twist = twist;
  estimate.covariance = bounded_covariance(estimate.information);
}

LidarOdometry::LidarOdometry(const Config& config) : impl_(std::make_unique<Impl>(config)) {}
LidarOdometry::~LidarOdometry() = default;
LidarOdometry::LidarOdometry(LidarOdometry&&) noexcept = default;
LidarOdometry& LidarOdometry::operator=(LidarOdometry&&) noexcept = default;

const Estimate& LidarOdometry::process(const Cloud& cloud, const Prior* prior) {
  impl_->process(cloud, prior);
  return impl_->estimate;
}

SweepStamps LidarOdometry::stamps(const Cloud& cloud) const {
  SweepStamps stamps{cloud.stamp_ns, cloud.stamp_ns, cloud.stamp_ns};
  const std::optional<TimeSpan> times = consistent(cloud) ? time_span(cloud) : std::nullopt;
  if (!times) return stamps;
  stamps.first_ns += std::llround(times->first / ns);
  stamps.last_ns += std::llround(times->last / ns);
  stamps.reference_ns += std::llround(impl_->reference_time(times) / ns);
  return stamps;
}

const Estimate& LidarOdometry::estimate() const {
  return impl_->estimate;
}

void LidarOdometry::reset() {
  impl_->pipeline->reset();
  impl_->estimate = {};
  impl_->started = false;
  impl_->odom_map = impl_->map_sensor = Pose::Identity();
  impl_->twist.setZero();
  impl_->twist_known = false;
  impl_->lost_in_a_row = 0;
  impl_->order.clear();
}

}  // namespace adit::lidar_odometry
