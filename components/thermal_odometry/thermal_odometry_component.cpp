#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "adit_msgs/msg/thermal_health.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "components/thermal_odometry/component_messages.hpp"
#include "components/thermal_odometry/points_picture.hpp"
#include "components/thermal_odometry/prior_motion.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"
#include "idl/thermal_frame_view.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using adit_msgs::msg::ThermalFrame;
using adit_msgs::msg::ThermalHealth;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::PointCloud2;
using thermal_odometry::Estimate;
using thermal_odometry::Mode;

// Takes `frame`, or `image_raw` while no `frame` has come; both are the same pictures.
class ThermalOdometryComponent final : public Component {
  using Numbers = std::vector<double>;

  Param<Mode> mode_{*this, "mode", Mode::anchored, Choices<Mode>{{"anchored", Mode::anchored}, {"mono", Mode::mono}},
                    "metric by LiDAR depth, or the paper's monocular odometry"};
  Param<std::int64_t> wanted_points_{*this, "points", 900, Range{50, 4000}, "pixels wanted at a keyframe"};
  Param<bool> bilateral_{*this, "bilateral", true, "smooth the image, keeping edges"};
  Param<double> usual_depth_{*this,       "usual_depth",      1.0,
                             Unit::metre, Range{0.01, 100.0}, "median depth a monocular map starts with: its scale"};
  Param<Numbers> camera_matrix_{*this, "camera_matrix", {}, "fx fy cx cy [px]; empty: from camera_info"};
  Param<std::vector<std::int64_t>> image_size_{*this, "image_size", {}, "width and height, with camera_matrix"};
  Param<Numbers> distortion_{*this, "distortion", {}, "k1 k2 p1 p2 [k3 [k4 k5 k6]], with camera_matrix"};
  Param<Numbers> thermal_pose_{
      *this, "thermal_pose", {}, "of the camera in base_frame: x y z [m], quaternion x y z w; empty: not known"};
  Param<Numbers> lidar_pose_{*this, "lidar_pose", {}, "of the LiDAR in base_frame; empty: not known, no depth from it"};
  Param<double> time_offset_{*this, "time_offset", 0.0, Unit::second, Range{-1.0, 1.0}, "added to the frames' stamps"};
  Param<double> lidar_time_offset_{*this,        "lidar_time_offset", 0.0,
                                   Unit::second, Range{-1.0, 1.0},    "added to the clouds' stamps"};
  Param<double> readout_time_{
      *this,        "readout_time",  0.0,
      Unit::second, Range{0.0, 0.1}, "from the first row to the last, where the frame does not say"};
  Param<double> time_constant_{
      *this,        "time_constant", 0.0,
      Unit::second, Range{0.0, 0.1}, "of the pixels, by which the picture lags, where the frame does not say"};
  Param<std::string> odom_frame_{*this, "odom_frame", std::string("thermal_odom"),
                                 "frame of the published poses: the camera's axes at its start"};
  Param<std::string> camera_frame_{*this, "camera_frame", std::string(), "instead of the frames' own; empty: that one"};
  Param<bool> scale_in_covariance_{*this, "scale_in_covariance", true,
                                   "the uncertainty of the scale is in the covariance (false: who reads it has a scale "
                                   "of its own to estimate)"};
  Param<bool> prior_as_information_{*this, "prior_as_information", false,
                                    "add `prior` to the normal equations, besides starting there"};

  Output<Odometry> odometry_{*this, "odometry", Qos::reliable(10)};
  Output<ThermalHealth> health_{*this, "health", Qos::reliable(10)};
  Output<Image> points_image_{*this, "points_image", Qos::reliable(2)};
  Input<CameraInfo> camera_info_{*this, "camera_info", Qos::sensor(), Queue{2, WhenFull::drop_oldest},
                                 [this](const CameraInfo& info, const MessageInfo&) { on_camera_info(info); }};
  Input<PointCloud2> points_{*this, "points", Qos::sensor(), Queue{2, WhenFull::drop_oldest},
                             [this](const PointCloud2& cloud, const MessageInfo&) { on_cloud(cloud); }};
  Input<Odometry> prior_{*this, "prior", Qos::reliable(100), Queue{100, WhenFull::drop_oldest},
                         [this](const Odometry& message, const MessageInfo&) { on_prior(message); }};
  Input<ThermalFrame> frame_{*this, "frame", Qos::sensor(), Queue{4, WhenFull::drop_oldest},
                             [this](const ThermalFrame& frame, const MessageInfo&) { on_frame(frame); }};
  Input<Image> image_{*this, "image_raw", Qos::sensor(), Queue{4, WhenFull::drop_oldest},
                      [this](const Image& image, const MessageInfo&) { on_image(image); }};

  struct Counts {
    std::uint64_t frames = 0;
    std::uint64_t refused = 0;
    std::uint64_t uncalibrated = 0;
    std::uint64_t dropped = 0;  // by the camera's own counter
    std::uint64_t measured = 0;
    std::uint64_t clouds = 0;
    std::uint64_t clouds_unused = 0;
  };

  thermal_odometry::CameraModel camera_;
  std::unique_ptr<thermal_odometry::ThermalOdometry> engine_;
  std::optional<Pose> camera_from_lidar_;
  std::optional<thermal_odometry::PriorMotion> prior_motion_;
  Counts counts_;
  std::string trouble_;            // why the last refused thing was refused
  std::string calibration_error_;  // of camera_info
  bool frames_come_ = false;       // as ThermalFrame: images are not used
  std::optional<std::uint32_t> last_counter_;
  bool frames_dropped_ = false;
  std::int64_t last_measured_ns_ = 0;
  std::int64_t last_published_ns_ = 0;

  std::vector<std::uint16_t> pixels_;
  thermal_odometry::CloudPoints cloud_;
  std::int64_t cloud_stamp_ns_ = 0;
  bool cloud_waiting_ = false;
  std::vector<thermal_odometry::MapPoint> map_points_;

  Result<void> configure() override;
  Result<void> activate() override;
  void on_time_jump(Duration) override;
  Result<void> calibrate(const thermal_odometry::CameraModel& camera);
  void set_row_time(double row_time);
  void on_camera_info(const CameraInfo& info);
  void on_cloud(const PointCloud2& message);
  void on_prior(const Odometry& message);
  void on_frame(const ThermalFrame& message);
  void on_image(const Image& message);
  void refuse(const std::string& why);
  void process(const ThermalFrameView& view, thermal_odometry::Frame frame, const std_msgs::msg::Header& header,
               double readout, double lag);
  void publish(const Estimate& estimate, const std_msgs::msg::Header& header);
  void draw(const thermal_odometry::Frame& frame, const std_msgs::msg::Header& header);
  void report(const Estimate& estimate);
};

Result<void> ThermalOdometryComponent::configure() {
  engine_.reset();
  calibration_error_.clear();
  camera_from_lidar_.reset();
  prior_motion_.reset();
  const Result<std::optional<Pose>> thermal = thermal_odometry::pose_if_known(thermal_pose_, "thermal_pose");
  const Result<std::optional<Pose>> lidar = thermal_odometry::pose_if_known(lidar_pose_, "lidar_pose");
  if (!thermal) return thermal.error();
  if (!lidar) return lidar.error();
  if (*lidar && !*thermal) return Error{ErrorCode::invalid_argument, "lidar_pose needs thermal_pose beside it"};
  if (*lidar) camera_from_lidar_ = (*thermal)->inverse() * **lidar;
  if (*thermal) {
    thermal_odometry::PriorMotion::Config config;
    config.body_from_camera = **thermal;
    prior_motion_.emplace(config);
  }
  if (camera_matrix_.value().empty()) return {};
  const auto camera = thermal_odometry::camera_of(camera_matrix_, image_size_, distortion_);
  if (!camera) return camera.error();
  return calibrate(*camera);
}

Result<void> ThermalOdometryComponent::calibrate(const thermal_odometry::CameraModel& camera) {
  thermal_odometry::Config config;
  config.mode = mode_;
  config.mapper.selection.wanted = static_cast<int>(wanted_points_.value());
  config.front_end.bilateral = bilateral_;
  config.usual_depth = usual_depth_;
  config.aligner.prior_as_information = prior_as_information_;
  auto engine = thermal_odometry::ThermalOdometry::create(camera, config);
  if (!engine) return engine.error();
  engine_ = std::move(*engine);
  camera_ = camera;
  map_points_.resize(4096);
  return {};
}

// The frame says how its rows follow each other, the calibration does not.
void ThermalOdometryComponent::set_row_time(double row_time) {
  if (std::abs(row_time - camera_.row_time) <= 0.01 * camera_.row_time) return;
  thermal_odometry::CameraModel camera = camera_;
  camera.row_time = row_time;
  if (const Result<void> done = calibrate(camera); !done) trouble_ = done.error().message;
}

Result<void> ThermalOdometryComponent::activate() {
  on_time_jump({});
  counts_ = {};
  trouble_.clear();
  if (mode_ == Mode::anchored && !camera_from_lidar_) {
    log().warn(
        "the pose of the LiDAR is not given (lidar_pose, thermal_pose): clouds are not used, scale is arbitrary");
  }
  return {};
}

void ThermalOdometryComponent::on_time_jump(Duration) {
  if (engine_) engine_->reset();
  if (prior_motion_) prior_motion_->clear();
  cloud_waiting_ = frames_come_ = false;
  last_counter_.reset();
  last_measured_ns_ = last_published_ns_ = 0;
}

void ThermalOdometryComponent::on_camera_info(const CameraInfo& info) {
  if (!camera_matrix_.value().empty()) return;
  const auto camera = thermal_odometry::camera_of(info);
  if (!camera) {
    if (calibration_error_ != camera.error().message) log().error("camera_info: {}", camera.error().message);
    calibration_error_ = camera.error().message;
    return;
  }
  if (engine_ && thermal_odometry::same(*camera, camera_)) return;
  if (engine_) log().warn("camera_info has changed: starting anew");
  const Result<void> done = calibrate(*camera);
  calibration_error_ = done ? std::string() : done.error().message;
  if (!done) log().error("camera_info: {}", calibration_error_);
}

void ThermalOdometryComponent::on_cloud(const PointCloud2& message) {
  ++counts_.clouds;
  const auto unused = [this](const std::string& why) {
    ++counts_.clouds_unused;
    trouble_ = why;
  };
  if (mode_ == Mode::mono) return;
  if (!camera_from_lidar_) return unused("the pose of the LiDAR is not given");
  // Two clouds between frames: the newer one, if it is one.
  const bool replaces = cloud_waiting_;
  cloud_waiting_ = false;
  if (replaces) ++counts_.clouds_unused;
  if (const Result<void> read = cloud_.read(message); !read) return unused(read.error().message);
  cloud_stamp_ns_ = thermal_odometry::nanoseconds(message.header.stamp) + std::llround(1e9 * lidar_time_offset_);
  cloud_waiting_ = true;
}

void ThermalOdometryComponent::on_prior(const Odometry& message) {
  if (!prior_motion_) return;
  if (const auto motion = thermal_odometry::body_motion_of(message)) prior_motion_->add(*motion);
}

void ThermalOdometryComponent::on_frame(const ThermalFrame& message) {
  frames_come_ = true;
  ++counts_.frames;
  frames_dropped_ = last_counter_ && message.frame_counter > *last_counter_ + 1;
  if (frames_dropped_) counts_.dropped += message.frame_counter - *last_counter_ - 1;
  last_counter_ = message.frame_counter;
  const Result<ThermalFrameView> view = ThermalFrameView::of(message);
  if (!view) return refuse(view.error().message);
  thermal_odometry::Frame frame;
  frame.ffc = message.ffc_state == ThermalFrame::FFC_IN_PROGRESS ? thermal_odometry::FfcState::in_progress
              : message.ffc_state == ThermalFrame::FFC_IMMINENT  ? thermal_odometry::FfcState::imminent
                                                                 : thermal_odometry::FfcState::idle;
  const auto known = [](float value) { return value > 0.0F && value < 0.1F; };
  process(*view, frame, message.header, known(message.readout_time) ? message.readout_time : readout_time_.value(),
          known(message.integration_time) ? message.integration_time : time_constant_.value());
}

void ThermalOdometryComponent::on_image(const Image& message) {
  if (frames_come_) return;
  ++counts_.frames;
  const Result<ThermalFrameView> view = ThermalFrameView::of(message);
  if (!view) return refuse(view.error().message);
  process(*view, {}, message.header, readout_time_, time_constant_);
}

void ThermalOdometryComponent::refuse(const std::string& why) {
  ++counts_.refused;
  trouble_ = why;
  health(Health::warn,
         std::to_string(counts_.refused) + " of " + std::to_string(counts_.frames) + " frames refused: " + trouble_);
}

// `frame` has everything but pixels and stamp.
void ThermalOdometryComponent::process(const ThermalFrameView& view, thermal_odometry::Frame frame,
                                       const std_msgs::msg::Header& header, double readout, double lag) {
  if (!engine_) {
    ++counts_.uncalibrated;
    const std::string why = calibration_error_.empty() ? "no camera_info yet" : "camera_info: " + calibration_error_;
    health(Health::warn, std::to_string(counts_.uncalibrated) + " frames without calibration: " + why);
    return;
  }
  if (view.height() == static_cast<std::size_t>(camera_.height)) set_row_time(readout / camera_.height);
  frame.width = static_cast<int>(view.width());
  frame.height = static_cast<int>(view.height());
  frame.saturation = view.saturation();
  thermal_odometry::view_pixels(view, frame, pixels_);
  frame.stamp_ns =
      thermal_odometry::nanoseconds(header.stamp) + std::llround(1e9 * (0.5 * readout - lag + time_offset_));

  std::optional<thermal_odometry::Prior> prior;
  if (prior_motion_ && last_measured_ns_ != 0) prior = prior_motion_->between(last_measured_ns_, frame.stamp_ns);
  thermal_odometry::DepthPoints depth;
  if (cloud_waiting_) depth = {cloud_.points, cloud_.seconds, cloud_stamp_ns_, *camera_from_lidar_};
  const Time begin = clock().now();
  const Estimate& estimate = engine_->process(frame, prior ? &*prior : nullptr, cloud_waiting_ ? &depth : nullptr);
  cloud_waiting_ = false;
  if (estimate.measured || estimate.new_keyframe) last_measured_ns_ = estimate.stamp_ns;
  if (estimate.measured) ++counts_.measured;
  if (estimate.measured || estimate.new_keyframe) publish(estimate, header);
  if (health_.has_readers()) {
    Loan<ThermalHealth> message = health_.loan();
    thermal_odometry::fill(estimate, prior ? &*prior : nullptr, *message);
    message->header = header;
    if (frames_dropped_) message->flags |= ThermalHealth::FLAG_FRAMES_DROPPED;
    const Time now = clock().now();
    message->processing_time = std::chrono::duration<float>(now - begin).count();
    message->latency = std::chrono::duration<float>(now - to_time(header.stamp)).count();
    health_.publish(std::move(message));
  }
  if (points_image_.has_readers()) draw(frame, header);
  report(estimate);
}

void ThermalOdometryComponent::publish(const Estimate& estimate, const std_msgs::msg::Header& header) {
  Loan<Odometry> message = odometry_.loan();
  message->header.stamp = to_stamp(Time(Duration(estimate.stamp_ns)));
  message->header.frame_id = odom_frame_.value();
  message->child_frame_id = camera_frame_.value().empty() ? header.frame_id : camera_frame_.value();
  // A step that no picture measured (the first pose of a map) has no information.
  const bool step_known =
      estimate.measured && last_published_ns_ != 0 && estimate.previous_stamp_ns == last_published_ns_;
  thermal_odometry::fill(estimate, step_known, scale_in_covariance_, *message);
  last_published_ns_ = estimate.stamp_ns;
  odometry_.publish(std::move(message));
}

void ThermalOdometryComponent::draw(const thermal_odometry::Frame& frame, const std_msgs::msg::Header& header) {
  if (frame.width != camera_.width || frame.height != camera_.height) return;
  Loan<Image> message = points_image_.loan();
  message->header = header;
  message->width = static_cast<std::uint32_t>(frame.width);
  message->height = static_cast<std::uint32_t>(frame.height);
  message->step = 3 * message->width;
  message->is_bigendian = 0;
  message->encoding = "rgb8";
  message->data.resize(std::size_t{message->step} * message->height);
  const std::size_t n = engine_->map_points(map_points_);
  const auto points = std::span(map_points_).first(n);
  thermal_odometry::DepthColours colours;
  if (engine_->estimate().scale == thermal_odometry::ScaleState::arbitrary && n > 0) {
    const auto middle = points.begin() + static_cast<std::ptrdiff_t>(n / 2);
    std::nth_element(points.begin(), middle, points.end(),
                     [](const auto& a, const auto& b) { return a.depth < b.depth; });
    colours = {0.3F * middle->depth, 5.0F * middle->depth};
  }
  thermal_odometry::draw_points(frame, camera_, points, colours, {message->data.mutable_data(), message->data.size()},
                                pixels_);
  points_image_.publish(std::move(message));
}

void ThermalOdometryComponent::report(const Estimate& estimate) {
  using thermal_odometry::Status;
  const bool fine = estimate.status == Status::tracking || estimate.status == Status::initialising;
  std::string reason = std::string(thermal_odometry::to_string(estimate.status)) + ": " +
                       std::to_string(counts_.measured) + " of " + std::to_string(counts_.frames) + " frames measured";
  const auto note = [&reason](std::uint64_t count, const char* what) {
    if (count > 0) reason += ", " + std::to_string(count) + " " + what;
  };
  for (int i = 1; i < thermal_odometry::verdict_count; ++i) {
    note(estimate.counters.verdicts[static_cast<std::size_t>(i)],
         thermal_odometry::to_string(static_cast<thermal_odometry::Verdict>(i)));
  }
  note(counts_.refused, "refused");
  note(counts_.uncalibrated, "without calibration");
  note(counts_.dropped, "dropped by the camera");
  note(estimate.counters.restarts, "restarts");
  note(counts_.clouds_unused, "clouds not used");
  if (!trouble_.empty() && counts_.refused + counts_.clouds_unused > 0) reason += " (" + trouble_ + ")";
  if (estimate.scale != thermal_odometry::ScaleState::metric) {
    reason += estimate.scale == thermal_odometry::ScaleState::carried ? "; scale carried" : "; scale arbitrary";
  }
  health(fine ? Health::ok : Health::warn, std::move(reason));
}

ADIT_COMPONENT(ThermalOdometryComponent, "thermal_odometry");

}  // namespace
}  // namespace adit
