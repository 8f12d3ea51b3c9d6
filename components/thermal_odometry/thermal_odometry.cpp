#include "components/thermal_odometry/thermal_odometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "components/thermal_odometry/cloud_buffer.hpp"

namespace adit::thermal_odometry {
namespace {

constexpr int window_size = 2;

double seconds(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

struct Keyframe {
  bool used = false;
  std::int64_t stamp_ns = 0;
  CameraState state;
  Pyramid image;
  int selected = 0;
  int anchored = 0;
};

}  // namespace

class ThermalOdometry::Engine {
 public:
  Engine(const CameraModel& camera, const Config& config)
      : config_(config),
        pinhole_{camera.fx, camera.fy, camera.cx, camera.cy},
        width_(camera.width),
        height_(camera.height),
        gate_(camera, config.gate),
        front_end_(camera, config.front_end),
        selector_(camera.width, camera.height, config.selection),
        anchor_(pinhole_, camera.width, camera.height, config.max_cloud_points, config.anchor),
        clouds_(config.max_cloud_points, config.max_cloud_age_s) {
    current_.allocate(width_, height_);
    for (Keyframe& keyframe : keyframes_) keyframe.image.allocate(width_, height_);
    const auto capacity = static_cast<std::size_t>(window_size * 2 * std::max(config.selection.wanted, 100));
    patches_.reserve(capacity);
    tracker_ = std::make_unique<Tracker>(pinhole_, current_.levels(), capacity, config.tracker);
  }

  const Estimate& process(const Frame& frame, const Prior* prior, const DepthPoints* depth) {
    if (depth != nullptr) clouds_.add(*depth);
    const Verdict verdict = gate_.check(frame, front_end_.calibrated() ? front_end_.noise() : 1.0F);
    begin_estimate(frame, verdict);
    if (verdict != Verdict::good) {
      out_.status = verdict == Verdict::frozen ? Status::frozen
                    : verdict == Verdict::ffc  ? Status::ffc
                                               : Status::invalid_frame;
      return out_;
    }
    if (!front_end_.calibrated()) front_end_.calibrate(frame);
    out_.noise_counts = front_end_.noise();
    front_end_.process(frame, current_);
    if (tracking_) {
      track(frame.stamp_ns, prior);
    } else {
      initialise(frame.stamp_ns);
    }
    return out_;
  }

  void reset() {
    restart();
    T_cw_ = Pose::Identity();
    last_stamp_ns_ = 0;
    out_.T_odom_camera = Pose::Identity();
  }

  const Estimate& estimate() const { return out_; }

  std::size_t map_points(std::span<MapPoint> out) const {
    std::size_t n = 0;
    if (newest_ < 0) return n;
    const Pose& T_nw = keyframes_[static_cast<std::size_t>(newest_)].state.T_cw;
    for (const Patch& patch : patches_) {
      if (n == out.size()) break;
      const Pose T = T_nw * keyframes_[static_cast<std::size_t>(patch.host)].state.T_cw.inverse();
      const double z = 1.0 / patch.inverse_depth;
      const Eigen::Vector3d X =
          T * Eigen::Vector3d((patch.u - pinhole_.cx) / pinhole_.fx * z, (patch.v - pinhole_.cy) / pinhole_.fy * z, z);
      if (!(X.z() > 0.0)) continue;
      out[n++] = {static_cast<float>(pinhole_.fx * X.x() / X.z() + pinhole_.cx),
                  static_cast<float>(pinhole_.fy * X.y() / X.z() + pinhole_.cy), static_cast<float>(X.z()), true};
    }
    return n;
  }

 private:
  void begin_estimate(const Frame& frame, Verdict verdict) {
    out_.stamp_ns = frame.stamp_ns;
    out_.verdict = verdict;
    out_.measured = false;
    out_.new_keyframe = false;
    out_.previous_stamp_ns = 0;
    out_.T_previous_camera = Pose::Identity();
    out_.information.setZero();
    out_.log_scale_correction = 0.0;
    ++out_.counters.verdicts[static_cast<std::size_t>(verdict)];
  }

  void restart() {
    tracking_ = false;
    for (Keyframe& keyframe : keyframes_) keyframe.used = false;
    newest_ = -1;
    patches_.clear();
    failures_ = 0;
    has_velocity_ = false;
    history_.clear();
  }

  void initialise(std::int64_t stamp_ns) {
    const CameraState start{T_cw_, 0.0, 0.0};
    history_.clear();
    history_.add(stamp_ns, T_cw_);
    out_.status = make_keyframe(stamp_ns, start) ? Status::tracking : Status::initialising;
    if (out_.selected < config_.min_points) out_.status = Status::low_texture;
    tracking_ = out_.status == Status::tracking;
    last_stamp_ns_ = stamp_ns;
  }

  // The frame in current_ becomes the newest keyframe if enough of its pixels have a depth. On success its image has
  // been swapped into the window.
  bool make_keyframe(std::int64_t stamp_ns, const CameraState& state) {
    const std::span<const Pixel> pixels = selector_.select(current_.level(0), front_end_.rectifier());
    out_.selected = static_cast<int>(pixels.size());
    out_.anchored = 0;
    anchor_.project(clouds_.at(stamp_ns, history_));
    const int slot = oldest_slot();
    const auto kept =
        std::partition(patches_.begin(), patches_.end(), [slot](const Patch& p) { return p.host != slot; });
    const auto first_new = static_cast<std::size_t>(kept - patches_.begin());
    fresh_begin_ = patches_.size();
    for (const Pixel& pixel : pixels) {
      if (patches_.size() == patches_.capacity()) break;
      const auto depth = anchor_.depth_at(pixel.u, pixel.v);
      if (!depth) continue;
      patches_.push_back({pixel.u, pixel.v, depth->inverse_depth, depth->slope_u, depth->slope_v, depth->sigma, slot});
    }
    out_.anchored = static_cast<int>(patches_.size() - fresh_begin_);
    if (out_.anchored < config_.min_points) {
      patches_.resize(fresh_begin_);
      return false;
    }
    patches_.erase(patches_.begin() + static_cast<std::ptrdiff_t>(first_new),
                   patches_.begin() + static_cast<std::ptrdiff_t>(fresh_begin_));
    Keyframe& keyframe = keyframes_[static_cast<std::size_t>(slot)];
    keyframe.used = true;
    keyframe.stamp_ns = stamp_ns;
    keyframe.state = state;
    keyframe.selected = out_.selected;
    keyframe.anchored = out_.anchored;
    std::swap(keyframe.image, current_);
    newest_ = slot;
    out_.new_keyframe = true;
    ++out_.counters.keyframes;
    set_reference();
    return true;
  }

  int oldest_slot() const {
    int best = 0;
    for (int i = 0; i < window_size; ++i) {
      const Keyframe& keyframe = keyframes_[static_cast<std::size_t>(i)];
      if (!keyframe.used) return i;
      if (keyframe.stamp_ns < keyframes_[static_cast<std::size_t>(best)].stamp_ns) best = i;
    }
    return best;
  }

  void set_reference() {
    std::array<ReferenceView, window_size> views;
    for (std::size_t i = 0; i < views.size(); ++i) {
      views[i].state = keyframes_[i].state;
      views[i].image = keyframes_[i].used ? &keyframes_[i].image : nullptr;
    }
    tracker_->set_reference(views, patches_, newest_);
  }

  void track(std::int64_t stamp_ns, const Prior* prior) {
    const double dt = seconds(stamp_ns - last_stamp_ns_);
    const bool gap = dt > config_.gap_s;
    const Keyframe& reference = keyframes_[static_cast<std::size_t>(newest_)];
    Vector6d predicted_twist = Vector6d::Zero();
    if (has_velocity_) predicted_twist = velocity_ * dt;
    const Pose constant_velocity = se3_exp(predicted_twist) * T_cw_;

    std::array<Pose, 3> starts{constant_velocity, T_cw_, T_cw_};
    int count = has_velocity_ && gap ? 2 : 1;
    Tracker::PosePrior pose_prior;
    const bool prior_usable =
        prior != nullptr && prior->T_previous_current.matrix().allFinite() && prior->covariance.allFinite();
    if (prior_usable) {
      pose_prior.T_cw = prior->T_previous_current.inverse() * T_cw_;
      // T_previous_current exp-left-increment covariance, carried to the left increment of T_cw.
      const Matrix6d adjoint = se3_adjoint(prior->T_previous_current.inverse());
      const Matrix6d covariance = adjoint * prior->covariance * adjoint.transpose() + 1e-12 * Matrix6d::Identity();
      pose_prior.information = covariance.ldlt().solve(Matrix6d::Identity());
      starts[static_cast<std::size_t>(count++)] = pose_prior.T_cw;
    }
    const int top = gap ? Pyramid::max_levels - 1 : 3;
    CameraState start{constant_velocity, last_a_, last_b_};
    if (gap) start.a = reference.state.a;
    double best_cost = std::numeric_limits<double>::infinity();
    for (int i = 0; i < count && count > 1; ++i) {
      CameraState candidate = start;
      candidate.T_cw = starts[static_cast<std::size_t>(i)];
      const double cost = tracker_->cost(current_, candidate, std::min(top, current_.levels() - 1));
      if (cost < best_cost) {
        best_cost = cost;
        start.T_cw = candidate.T_cw;
      }
    }
    const Tracker::PosePrior* information = prior_usable && config_.prior_as_information ? &pose_prior : nullptr;
    TrackResult result = tracker_->track(current_, start, top, information);
    if (!result.ok) result = search(start, information);
    report(result);
    if (!result.ok) {
      fail(stamp_ns, constant_velocity);
      return;
    }
    accept(stamp_ns, dt, result);
    const double age = seconds(stamp_ns - reference.stamp_ns);
    const bool moved_on = result.median_flow > config_.keyframe_flow * width_ ||
                          result.visible_share < config_.min_visible_share || age > config_.max_keyframe_age_s;
    const bool young_map = map_keyframes_ < 4;
    if (gap || young_map || (age >= config_.min_keyframe_age_s && moved_on)) {
      if (make_keyframe(stamp_ns, result.state)) ++map_keyframes_;
    }
  }

  // Small rotations about the start, from the coarsest level: only after a failure.
  TrackResult search(const CameraState& start, const Tracker::PosePrior* prior) {
    TrackResult best;
    const int top = current_.levels() - 1;
    double best_cost = std::numeric_limits<double>::infinity();
    CameraState best_start = start;
    for (int i = 0; i < 27; ++i) {
      const Eigen::Vector3d axis(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      for (double angle : {0.03, 0.07}) {
        CameraState candidate = start;
        candidate.T_cw = Pose(so3_exp(angle * axis)) * start.T_cw;
        const double cost = tracker_->cost(current_, candidate, top);
        if (cost < best_cost) {
          best_cost = cost;
          best_start = candidate;
        }
      }
    }
    if (std::isfinite(best_cost)) best = tracker_->track(current_, best_start, top, prior);
    if (best.ok) return best;
    CameraState still = start;
    still.T_cw = T_cw_;
    return tracker_->track(current_, still, top, prior);
  }

  void report(const TrackResult& result) {
    out_.points = result.points;
    out_.residual = std::isfinite(result.sigma) ? result.sigma : 0.0F;
    out_.inlier_share = result.inlier_share;
    out_.visible_share = result.visible_share;
    out_.correlation = result.correlation;
  }

  void accept(std::int64_t stamp_ns, double dt, const TrackResult& result) {
    const Keyframe& reference = keyframes_[static_cast<std::size_t>(newest_)];
    const Pose T_current_previous = result.state.T_cw * T_cw_.inverse();
    if (failures_ == 0) {
      out_.previous_stamp_ns = last_stamp_ns_;
      out_.T_previous_camera = T_current_previous.inverse();
    }
    velocity_ = se3_log(T_current_previous) / dt;
    has_velocity_ = true;
    T_cw_ = result.state.T_cw;
    last_a_ = result.state.a;
    last_b_ = result.state.b;
    last_stamp_ns_ = stamp_ns;
    failures_ = 0;
    history_.add(stamp_ns, T_cw_);
    ++out_.counters.tracked;

    out_.status = Status::tracking;
    out_.measured = true;
    out_.T_odom_camera = T_cw_.inverse();
    out_.keyframe_stamp_ns = reference.stamp_ns;
    out_.T_keyframe_camera = reference.state.T_cw * out_.T_odom_camera;
    out_.information = result.information;
    out_.gain = static_cast<float>(result.state.a - reference.state.a);
    out_.offset = static_cast<float>(result.state.b - reference.state.b);
    out_.scale = ScaleState::metric;
    out_.log_scale_sigma = 0.004;
    const Matrix6d regular = result.information + 1e-6 * Matrix6d::Identity();
    out_.covariance = config_.correlation * regular.ldlt().solve(Matrix6d::Identity());
    const Eigen::Vector3d moved = out_.T_keyframe_camera.rotation().transpose() * out_.T_keyframe_camera.translation();
    out_.covariance.topLeftCorner<3, 3>() += out_.log_scale_sigma * out_.log_scale_sigma * moved * moved.transpose();
  }

  // Not aligned: keep the map and the last measured pose, report the prediction, give the map up after a few frames.
  void fail(std::int64_t stamp_ns, const Pose& predicted) {
    ++out_.counters.failed;
    ++failures_;
    out_.status = Status::recovering;
    out_.T_odom_camera = predicted.inverse();
    if (failures_ < config_.restart_after) return;
    ++out_.counters.restarts;
    restart();
    map_keyframes_ = 0;
    if (predicted.matrix().allFinite()) T_cw_ = predicted;
    last_stamp_ns_ = stamp_ns;
  }

  Config config_;
  Pinhole pinhole_;
  int width_;
  int height_;
  FrameGate gate_;
  FrontEnd front_end_;
  PixelSelector selector_;
  DepthAnchor anchor_;
  CloudBuffer clouds_;
  PoseHistory history_;
  std::unique_ptr<Tracker> tracker_;
  Pyramid current_;
  std::array<Keyframe, window_size> keyframes_;
  int newest_ = -1;
  int map_keyframes_ = 0;
  std::vector<Patch> patches_;
  std::size_t fresh_begin_ = 0;

  bool tracking_ = false;
  Pose T_cw_ = Pose::Identity();
  double last_a_ = 0.0;
  double last_b_ = 0.0;
  std::int64_t last_stamp_ns_ = 0;
  Vector6d velocity_ = Vector6d::Zero();
  bool has_velocity_ = false;
  int failures_ = 0;
  Estimate out_;
};

ThermalOdometry::ThermalOdometry(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}
ThermalOdometry::~ThermalOdometry() = default;

Result<std::unique_ptr<ThermalOdometry>> ThermalOdometry::create(const CameraModel& camera, const Config& config) {
  if (Result<void> checked = check(camera); !checked) return checked.error();
  if (config.selection.wanted < 50 || config.selection.wanted > 4000) {
    return Error{ErrorCode::invalid_argument, "selection.wanted must be in 50 ... 4000"};
  }
  return std::unique_ptr<ThermalOdometry>(new ThermalOdometry(std::make_unique<Engine>(camera, config)));
}

const Estimate& ThermalOdometry::process(const Frame& frame, const Prior* prior, const DepthPoints* depth) {
  return engine_->process(frame, prior, depth);
}
const Estimate& ThermalOdometry::estimate() const {
  return engine_->estimate();
}
void ThermalOdometry::reset() {
  engine_->reset();
}
std::size_t ThermalOdometry::map_points(std::span<MapPoint> out) const {
  return engine_->map_points(out);
}

}  // namespace adit::thermal_odometry
