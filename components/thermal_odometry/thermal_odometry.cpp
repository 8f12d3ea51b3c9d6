#include "components/thermal_odometry/thermal_odometry.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "components/thermal_odometry/cloud_buffer.hpp"
#include "components/thermal_odometry/frame_aligner.hpp"

namespace adit::thermal_odometry {
namespace {

// Growth of the scale's uncertainty without LiDAR: 0.7 % in 10 m. Measured over twelve outages of 40 to 160 m in drives
// that kept their map: errors of 0.46 sigma rms, at most 0.93 (doc/figures.md).
constexpr double scale_walk = 0.007 * 0.007 / 10.0;
constexpr double scale_floor = 0.004;
// Of a map begun anew from motion, made as deep as the last one was by the median of the points either happened to see
// (measured: 22 % off).
constexpr double restart_sigma = 0.25;

double seconds(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

}  // namespace

class ThermalOdometry::Engine {
 public:
  Engine(const CameraModel& camera, const Config& config)
      : config_(config),
        pinhole_(pinhole_of(camera)),
        width_(camera.width),
        height_(camera.height),
        gate_(camera, config.gate),
        front_end_(camera, config.front_end),
        mapper_(camera, Pyramid::max_levels, config.mapper),
        aligner_(config.aligner) {
    current_.allocate(width_, height_);
    const auto capacity = static_cast<std::size_t>(4 * std::max(config.mapper.selection.wanted, 200) + 400);
    tracker_ = std::make_unique<Tracker>(pinhole_, current_.levels(), capacity, config.tracker);
    initialiser_ = std::make_unique<Initialiser>(pinhole_, width_, current_.levels(), capacity, config.initialiser);
    start_patches_.reserve(capacity);
    initialiser_->first_image().allocate(width_, height_);
  }

  const Estimate& process(const Frame& frame, const Prior* prior, const DepthPoints* depth) {
    if (depth != nullptr) mapper_.add_cloud(*depth);
    // Without a map the noise may be that of garbage: only exact repetitions count as frozen then.
    const bool unit_known = tracking_ || initialiser_->active();
    const Verdict verdict = gate_.check(frame, unit_known ? front_end_.noise() : 1.0F);
    begin_estimate(frame, verdict);
    if (verdict != Verdict::good) {
      out_.status = verdict == Verdict::frozen ? Status::frozen
                    : verdict == Verdict::ffc  ? Status::ffc
                                               : Status::invalid_frame;
      return out_;
    }
    if (gate_.clock_set_back()) restart();
    if (!unit_known) front_end_.calibrate(frame);
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
    aligner_.place(0, Pose::Identity());
    last_frame_ns_ = 0;
    out_.T_odom_camera = Pose::Identity();
  }

  const Estimate& estimate() const { return out_; }

  std::size_t map_points(std::span<MapPoint> out) const {
    std::size_t n = 0;
    if (mapper_.empty()) return n;
    const Window& window = mapper_.window();
    for (const WindowPoint& point : window.points()) {
      if (n == out.size()) break;
      const Patch& patch = point.patch;
      const Warp warp(window.keyframe(patch.host).state, {aligner_.T_cw(), 0.0, 0.0}, pinhole_);
      const Eigen::Vector3f X = warp.ray(patch.u, patch.v, patch.inverse_depth);
      if (!(X.z() > 0.05F)) continue;
      const Eigen::Vector2f p = warp.pixel(X);
      out[n++] = {p.x(), p.y(), X.z() / patch.inverse_depth, point.anchored()};
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

  bool lidar() const { return config_.mode == Mode::anchored; }

  void restart() {
    if (!mapper_.empty()) carried_inverse_depth_ = mapper_.median_inverse_depth();
    tracking_ = false;
    mapper_.clear();
    initialiser_->stop();
    map_keyframes_ = 0;
    failures_ = 0;
    aligner_.forget_velocity();
    history_.clear();
  }

  void initialise(std::int64_t stamp_ns) {
    history_.clear();
    history_.add(stamp_ns, aligner_.T_cw());
    out_.status = Status::initialising;
    if (lidar()) {
      const Mapper::Report report = mapper_.add_keyframe(stamp_ns, {aligner_.T_cw(), 0.0, 0.0}, current_,
                                                         front_end_.rectifier(), history_, true, 1.5F);
      note(report);
      if (!report.textured) out_.status = Status::low_texture;
      if (report.made) {
        begin_map(stamp_ns);
        return;
      }
    }
    initialise_from_motion(stamp_ns);
  }

  void initialise_from_motion(std::int64_t stamp_ns) {
    if (initialiser_->active() && stamp_ns - last_frame_ns_ > static_cast<std::int64_t>(3e9 * config_.aligner.gap_s))
      initialiser_->stop();
    last_frame_ns_ = stamp_ns;
    if (initialiser_->active()) {
      const Initialiser::Outcome outcome = initialiser_->add(stamp_ns, current_);
      out_.residual = initialiser_->sigma();
      out_.inlier_share = initialiser_->inlier_share();
      if (outcome == Initialiser::Outcome::waiting) return;
      if (outcome == Initialiser::Outcome::done && start_map(stamp_ns)) return;
      initialiser_->stop();
    }
    const std::span<const Pixel> pixels = mapper_.select(current_, front_end_.rectifier());
    out_.selected = static_cast<int>(pixels.size());
    if (out_.selected < config_.mapper.min_points || !mapper_.textured()) {
      out_.status = Status::low_texture;
      return;
    }
    initialiser_->start(stamp_ns, current_, pixels);
  }

  // Two views agree: scale them to the last map's median depth, or to the usual depth.
  bool start_map(std::int64_t stamp_ns) {
    const std::span<const Patch> found = initialiser_->patches();
    if (static_cast<int>(found.size()) < config_.mapper.min_points) return false;
    std::vector<Patch>& patches = start_patches_;
    patches.assign(found.begin(), found.end());
    const auto middle = patches.begin() + static_cast<std::ptrdiff_t>(patches.size() / 2);
    std::nth_element(patches.begin(), middle, patches.end(),
                     [](const Patch& a, const Patch& b) { return a.inverse_depth < b.inverse_depth; });
    const auto usual = static_cast<float>(1.0 / config_.usual_depth);
    const float target = carried_inverse_depth_ > 0.0F ? carried_inverse_depth_ : usual;
    const float factor = target / middle->inverse_depth;
    for (Patch& patch : patches) {
      patch.inverse_depth *= factor;
      patch.sigma *= factor;
    }
    const CameraState first{aligner_.T_cw(), 0.0, 0.0};
    CameraState second = initialiser_->state();
    second.T_cw.translation() /= static_cast<double>(factor);
    second.rate.head<3>() /= static_cast<double>(factor);
    second.T_cw = second.T_cw * first.T_cw;
    const Mapper::Report report =
        mapper_.start(initialiser_->stamp_ns(), first, initialiser_->first_image(), patches, stamp_ns, second, current_,
                      front_end_.rectifier(), initialiser_->sigma());
    note(report);
    if (report.failed) {
      mapper_.clear();
      return false;
    }
    const Vector6d moved = se3_log(mapper_.newest().state.T_cw * first.T_cw.inverse());
    aligner_.set_velocity(moved / std::max(1e-3, seconds(stamp_ns - initialiser_->stamp_ns())));
    if (out_.scale == ScaleState::metric) out_.scale = ScaleState::carried;
    if (out_.scale == ScaleState::carried) out_.log_scale_sigma = std::hypot(out_.log_scale_sigma, restart_sigma);
    initialiser_->stop();
    begin_map(stamp_ns);
    return true;
  }

  void begin_map(std::int64_t stamp_ns) {
    tracking_ = true;
    out_.status = Status::tracking;
    out_.new_keyframe = true;
    map_keyframes_ = 1;
    ++out_.counters.keyframes;
    mapper_.set_reference(*tracker_);
    aligner_.begin_at(stamp_ns, mapper_.newest().state);
    history_.clear();
    note_keyframe(stamp_ns);
  }

  void note(const Mapper::Report& report) {
    out_.selected = report.selected;
    out_.anchored = report.anchored;
    if (!report.made) return;
    if (report.metric) {
      out_.scale = ScaleState::metric;
      out_.log_scale_sigma = scale_floor;
    } else if (out_.scale == ScaleState::metric) {
      out_.scale = ScaleState::carried;
    }
    out_.boresight = mapper_.window().boresight();
    out_.boresight_covariance = mapper_.window().boresight_covariance();
    out_.log_scale_correction = report.log_scale_correction;
    if (report.log_scale_correction != 0.0) ++out_.counters.scale_corrections;
  }

  void make_keyframe(std::int64_t stamp_ns, const TrackResult& result) {
    const Mapper::Report report = mapper_.add_keyframe(stamp_ns, result.state, current_, front_end_.rectifier(),
                                                       history_, lidar(), std::max(0.7F, result.sigma));
    note(report);
    if (report.failed) {
      ++out_.counters.restarts;
      restart();
      return;
    }
    if (!report.made) return;
    ++map_keyframes_;
    ++out_.counters.keyframes;
    out_.new_keyframe = true;
    mapper_.set_reference(*tracker_);
    aligner_.correct(mapper_.newest().state);
    if (report.log_scale_correction != 0.0) {
      aligner_.rescale(std::exp(report.log_scale_correction));
      history_.clear();
    }
    note_keyframe(stamp_ns);
  }

  // The newest frame is the newest keyframe: poses are said relative to it from now on.
  void note_keyframe(std::int64_t stamp_ns) {
    if (history_.size() == 0) history_.add(stamp_ns, aligner_.T_cw());
    out_.T_odom_camera = aligner_.T_cw().inverse();
    out_.keyframe_stamp_ns = stamp_ns;
    out_.T_keyframe_camera = Pose::Identity();
  }

  void track(std::int64_t stamp_ns, const Prior* prior) {
    const Keyframe& reference = mapper_.newest();
    const FrameAligner::Alignment alignment = aligner_.align(*tracker_, current_, stamp_ns, reference.state.a, prior);
    const TrackResult& result = alignment.result;
    report(result);
    if (!result.ok) {
      // Residuals like noise, but nothing in them that both images have: there is no texture to be lost.
      const bool empty = result.inlier_share > 0.8F && result.correlation < 0.5F * config_.tracker.min_correlation;
      fail(stamp_ns, alignment.predicted, empty ? Status::low_texture : Status::recovering);
      return;
    }
    accept(stamp_ns, result);
    if (alignment.gap || moved_on(stamp_ns, result)) make_keyframe(stamp_ns, result);
  }

  bool moved_on(std::int64_t stamp_ns, const TrackResult& result) const {
    const bool anchored = out_.scale == ScaleState::metric;
    const double age = seconds(stamp_ns - mapper_.newest().stamp_ns);
    const double min_age = anchored ? config_.anchored_keyframe_age_s : config_.mono_keyframe_age_s;
    const double flow = (anchored ? config_.anchored_keyframe_flow : config_.mono_keyframe_flow) * width_;
    const double visible = anchored ? config_.anchored_visible_share : config_.mono_visible_share;
    const bool moved = result.median_flow > flow || result.visible_share < visible ||
                       (age > config_.max_keyframe_age_s && (anchored || result.median_flow > 0.3 * flow));
    const bool young_map = anchored && map_keyframes_ < 4;
    const bool vanishing = age >= config_.young_keyframe_age_s && result.visible_share < 0.67 * visible;
    return young_map || vanishing || (age >= min_age && moved);
  }

  void report(const TrackResult& result) {
    out_.points = result.points;
    out_.residual = std::isfinite(result.sigma) ? result.sigma : 0.0F;
    out_.inlier_share = result.inlier_share;
    out_.visible_share = result.visible_share;
    out_.correlation = result.correlation;
    out_.flow = result.median_flow;
  }

  void accept(std::int64_t stamp_ns, const TrackResult& result) {
    const Keyframe& reference = mapper_.newest();
    const Pose T_current_previous = result.state.T_cw * aligner_.T_cw().inverse();
    if (failures_ == 0) {
      out_.previous_stamp_ns = aligner_.stamp_ns();
      out_.T_previous_camera = T_current_previous.inverse();
    }
    aligner_.move_to(stamp_ns, result.state);
    failures_ = 0;
    history_.add(stamp_ns, aligner_.T_cw());
    ++out_.counters.tracked;

    out_.status = Status::tracking;
    out_.measured = true;
    out_.T_odom_camera = aligner_.T_cw().inverse();
    out_.keyframe_stamp_ns = reference.stamp_ns;
    out_.T_keyframe_camera = reference.state.T_cw * out_.T_odom_camera;
    out_.information = result.information;
    out_.gain = static_cast<float>(result.state.a - reference.state.a);
    out_.offset = static_cast<float>(result.state.b - reference.state.b);
    if (out_.scale == ScaleState::carried) {
      const double walked = T_current_previous.translation().norm();
      out_.log_scale_sigma = std::sqrt(out_.log_scale_sigma * out_.log_scale_sigma + scale_walk * walked);
    }
    const Matrix6d regular = result.information + 1e-6 * Matrix6d::Identity();
    // The information is about the left increment of T_cw; the right increment of its inverse is its negative.
    out_.covariance = config_.correlation * regular.ldlt().solve(Matrix6d::Identity());
    out_.step_covariance = out_.covariance;
    const Eigen::Vector3d moved = out_.T_keyframe_camera.rotation().transpose() * out_.T_keyframe_camera.translation();
    out_.covariance.topLeftCorner<3, 3>() += out_.log_scale_sigma * out_.log_scale_sigma * moved * moved.transpose();
  }

  // Not aligned: keep the map and the last measured pose, report the prediction, give the map up after a few frames.
  void fail(std::int64_t stamp_ns, const Pose& predicted, Status status) {
    ++out_.counters.failed;
    ++failures_;
    out_.status = status;
    out_.T_odom_camera = predicted.inverse();
    if (failures_ < config_.restart_after) return;
    ++out_.counters.restarts;
    restart();
    aligner_.place(stamp_ns, predicted.matrix().allFinite() ? predicted : aligner_.T_cw());
    last_frame_ns_ = stamp_ns;
  }

  Config config_;
  Pinhole pinhole_;
  int width_;
  int height_;
  FrameGate gate_;
  FrontEnd front_end_;
  Mapper mapper_;
  PoseHistory history_;
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<Initialiser> initialiser_;
  Pyramid current_;
  std::vector<Patch> start_patches_;
  int map_keyframes_ = 0;
  float carried_inverse_depth_ = 0.0F;

  bool tracking_ = false;
  FrameAligner aligner_;
  std::int64_t last_frame_ns_ = 0;  // while the map is being started
  int failures_ = 0;
  Estimate out_;
};

ThermalOdometry::ThermalOdometry(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}
ThermalOdometry::~ThermalOdometry() = default;

Result<std::unique_ptr<ThermalOdometry>> ThermalOdometry::create(const CameraModel& camera, const Config& config) {
  if (Result<void> checked = check(camera); !checked) return checked.error();
  if (config.mapper.selection.wanted < 50 || config.mapper.selection.wanted > 4000) {
    return Error{ErrorCode::invalid_argument, "selection.wanted must be in 50 ... 4000"};
  }
  if (!(config.usual_depth > 1e-3 && config.usual_depth < 1e3)) {
    return Error{ErrorCode::invalid_argument, "usual_depth must be in 0.001 ... 1000"};
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
