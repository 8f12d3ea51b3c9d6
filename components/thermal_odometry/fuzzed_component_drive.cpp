#include "components/thermal_odometry/fuzzed_component_drive.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "adit_msgs/msg/thermal_health.hpp"
#include "components/geometry/rigid.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/stamp.hpp"
#include "components/thermal_odometry/test_lap.hpp"
#include "idl/point_cloud_writer.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit::thermal_odometry {
namespace {

using adit_msgs::msg::ThermalFrame;
using adit_msgs::msg::ThermalHealth;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::PointCloud2;

constexpr std::array<std::string_view, fault_count> names{
    "noise",        "weak noise",   "black",         "saturated",    "duplicate",   "shutter",     "8 bit low",
    "8 bit high",   "wrong size",   "malformed",     "reordered",    "blocks",      "inverted",    "dead pixels",
    "gain jump",    "dropped",      "clock back",    "clock fwd.",   "stamp spike", "telemetry",   "cloud NaN",
    "cloud scaled", "cloud absent", "cloud mutated", "cloud stamps", "prior wild",  "camera info", "camera invalid"};

bool shows_nothing(Fault fault) {
  return fault <= Fault::reordered;
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t period_ns = 40'000'000;

// One frame after the other with what belongs to it; checks what came of the last one before it makes the next.
class FuzzedDrive final : public OfflineSource {
 public:
  FuzzedDrive(int frames, std::uint32_t seed) : frames_(frames), random_(seed) { queue_info(lap_.camera().fx); }

  Result<bool> next(OfflineMessage& out) override {
    while (at_ == queue_.size()) {
      if (figures_.frames > 0) judge();
      if (figures_.frames == frames_) return false;
      queue_.clear();
      at_ = 0;
      make_frame();
    }
    out = queue_[at_++];
    return true;
  }

  void on_odometry(const Odometry& m) {
    double sum = 0.0;
    const auto& p = m.pose.pose.position;
    const auto& q = m.pose.pose.orientation;
    for (const double x : {p.x, p.y, p.z, q.x, q.y, q.z, q.w}) sum += x;
    for (const double x : m.pose.covariance) sum += x;
    for (const double x : m.twist.covariance) sum += x;
    const auto& v = m.twist.twist.linear;
    const auto& w = m.twist.twist.angular;
    for (const double x : {v.x, v.y, v.z, w.x, w.y, w.z}) sum += x;
    bool fine = std::isfinite(sum);
    for (std::size_t i = 0; i < 36; i += 7) fine = fine && m.pose.covariance[i] > 0.0 && m.twist.covariance[i] > 0.0;
    figures_.not_finite += fine ? 0 : 1;
    speed_ = v.z;
    speed_sigma_ = std::sqrt(m.twist.covariance[14]);
    published_ = true;
  }
  void on_health(const ThermalHealth& m) {
    const double sum = static_cast<double>(m.inlier_share + m.anchored_share + m.residual_rms + m.noise_sigma + m.gain +
                                           m.offset + m.parallax + m.scale_sigma) +
                       m.weakest_information + m.weakest_direction[0] + m.weakest_direction[1] + m.weakest_direction[2];
    figures_.not_finite += std::isfinite(sum) && m.state <= ThermalHealth::LOST ? 0 : 1;
    measured_ = m.state == ThermalHealth::OK && m.active_points > 0;
  }
  const FuzzFigures& figures() const { return figures_; }

 private:
  std::uint32_t draw(std::uint32_t below) { return static_cast<std::uint32_t>(random_()) % below; }
  double uniform(double from, double to) {
    return from + (to - from) * (static_cast<double>(random_()) / 4294967295.0);
  }

  template <class T>
  void queue(const char* topic, std::shared_ptr<T> message) {
    queue_.push_back(offline_message<T>(topic, arrival_, std::move(message)));
  }

  void queue_info(double focal) {
    auto info = std::make_shared<CameraInfo>();
    info->width = static_cast<std::uint32_t>(lap_.camera().width);
    info->height = static_cast<std::uint32_t>(lap_.camera().height);
    info->distortion_model = "plumb_bob";
    info->d = {0, 0, 0, 0, 0};
    info->k = {focal, 0, lap_.camera().cx, 0, focal, lap_.camera().cy, 0, 0, 1};
    queue("/camera_info", std::move(info));
  }

  void queue_invalid_info() {
    auto info = std::make_shared<CameraInfo>();
    info->width = draw(3) == 0 ? 0 : draw(0x7FFFFFFF);
    info->height = 128;
    info->distortion_model = draw(2) == 0 ? "equidistant" : "plumb_bob";
    info->d.assign(draw(12), draw(2) == 0 ? nan : 1e300);
    info->k = {draw(2) == 0 ? nan : 0.0, 0, 1e300, 0, -105.0, 63.5, 0, 0, 1};
    queue("/camera_info", std::move(info));
  }

  // Good and bad stretches in turn. What a fault has changed for good is taken back at its end.
  void plan() {
    if (left_ > 0) {
      --left_;
      return;
    }
    bad_ = !bad_;
    if (bad_) {
      // Each fault once before any comes again.
      if (order_.empty()) {
        for (int i = 0; i < fault_count; ++i) order_.push_back(static_cast<Fault>(i));
        for (std::size_t i = order_.size() - 1; i > 0; --i)
          std::swap(order_[i], order_[draw(static_cast<std::uint32_t>(i + 1))]);
      }
      fault_ = order_.back();
      order_.pop_back();
      left_ = static_cast<int>(draw(25));
      if (fault_ == Fault::stamp_spike) left_ = 0;
      frames_left_at_start_ = left_;
      if (fault_ == Fault::clock_back) clock_ns_ -= static_cast<std::int64_t>(1e9 * uniform(1.0, 600.0));
      if (fault_ == Fault::clock_forward) clock_ns_ += static_cast<std::int64_t>(1e9 * uniform(1.0, 600.0));
      if (fault_ == Fault::camera_info) queue_info(uniform(60.0, 300.0));
      ++of_fault().episodes;
    } else {
      if (fault_ == Fault::camera_info) queue_info(lap_.camera().fx);
      left_ = 24 + static_cast<int>(draw(30));
      since_fault_ = 0;
      recovered_ = false;
    }
  }

  FuzzFigures::OfFault& of_fault() { return figures_.faults[static_cast<std::size_t>(fault_)]; }

  void make_frame() {
    ++figures_.frames;
    arrival_ = Time(Duration(1'000'000'000'000 + figures_.frames * period_ns));
    last_position_ = position_;
    position_ = (position_ + 1) % TestLap::frames;
    plan();
    published_ = measured_ = false;
    const std::int64_t stamp = clock_ns_ + figures_.frames * period_ns;
    if (position_ % TestLap::scan_every == 0) make_cloud(stamp);
    if (bad_ && fault_ == Fault::prior_wild) make_prior(stamp);
    if (bad_ && fault_ == Fault::camera_invalid) queue_invalid_info();
    make_picture(stamp);
  }

  void make_cloud(std::int64_t stamp) {
    if (bad_ && fault_ == Fault::cloud_absent) return;
    std::vector<LidarPoint> points = lap_.cloud(position_);
    if (bad_ && fault_ == Fault::cloud_nan) {
      for (LidarPoint& p : points) p.x = p.y = p.z = std::numeric_limits<float>::quiet_NaN();
    }
    if (bad_ && fault_ == Fault::cloud_scaled) {
      for (LidarPoint& p : points) {
        const auto factor = static_cast<float>(uniform(-50.0, 50.0));
        p.x *= factor, p.y *= factor, p.z *= factor;
      }
    }
    auto cloud = std::make_shared<PointCloud2>();
    if (bad_ && fault_ == Fault::cloud_stamps) stamp += static_cast<std::int64_t>(1e9 * uniform(-1e4, 1e4));
    cloud->header.stamp = to_stamp(Time(Duration(stamp)));
    const auto layout = bad_ && fault_ == Fault::cloud_mutated ? static_cast<PointLayout>(draw(3)) : PointLayout::xyzi;
    if (!write_points(points, 1, layout, *cloud)) return;
    if (bad_ && fault_ == Fault::cloud_mutated) {
      for (int i = 0; i < 50; ++i)
        cloud->data.mutable_data()[draw(static_cast<std::uint32_t>(cloud->data.size()))] =
            static_cast<std::uint8_t>(draw(256));
      if (draw(2) == 0) cloud->fields[draw(static_cast<std::uint32_t>(cloud->fields.size()))].offset = draw(64);
      if (draw(3) == 0)
        cloud->fields[draw(static_cast<std::uint32_t>(cloud->fields.size()))].datatype =
            static_cast<std::uint8_t>(draw(16));
      if (draw(3) == 0) cloud->fields.resize(draw(4));
      if (draw(3) == 0) cloud->point_step = draw(64);
      if (draw(3) == 0) cloud->width = draw(1U << 30U);
      if (draw(3) == 0) cloud->data.resize(draw(static_cast<std::uint32_t>(cloud->data.size())));
    }
    queue("/points", std::move(cloud));
  }

  void make_prior(std::int64_t stamp) {
    auto prior = std::make_shared<Odometry>();
    prior->header.stamp = to_stamp(Time(Duration(stamp - static_cast<std::int64_t>(draw(100'000'000)))));
    const double wild = draw(3) == 0 ? nan : uniform(-1e6, 1e6);
    prior->pose.pose.position.x = wild;
    prior->pose.pose.orientation.w = draw(4) == 0 ? wild : 1.0;
    prior->twist.twist.linear.x = draw(2) == 0 ? wild : 3.0;
    prior->twist.twist.angular.z = draw(2) == 0 ? wild : 0.0;
    for (double& c : prior->twist.covariance) c = draw(3) == 0 ? nan : uniform(-1.0, 1.0);
    queue("/prior", std::move(prior));
  }

  void make_picture(std::int64_t stamp) {
    const Fault fault = fault_;
    if (bad_ && fault == Fault::dropped && draw(3) != 0) return;
    auto frame = std::make_shared<ThermalFrame>();
    const bool repeated = bad_ && (fault == Fault::duplicate || fault == Fault::shutter);
    if (!repeated) shown_ = position_;
    pixels_ = lap_.picture(shown_);
    if (bad_ && fault == Fault::reordered) stamp -= 2 * period_ns * (frames_left_at_start_ - left_ + 1);
    if (bad_ && fault == Fault::stamp_spike) stamp += 3'600'000'000'000;
    if (bad_) spoil_pixels();
    frame->header.stamp = to_stamp(Time(Duration(stamp)));
    frame->header.frame_id = "thermal_optical";
    frame->width = static_cast<std::uint32_t>(lap_.camera().width);
    frame->height = static_cast<std::uint32_t>(lap_.camera().height);
    frame->significant_bits = 16;
    frame->frame_counter = static_cast<std::uint32_t>(figures_.frames);
    if (bad_ && fault == Fault::shutter) frame->ffc_state = ThermalFrame::FFC_IN_PROGRESS;
    if (bad_ && fault == Fault::wrong_size) {
      frame->width = 8 + draw(300);
      frame->height = 8 + draw(300);
      if (frame->width == 160 && frame->height == 128) frame->height = 127;
      pixels_.resize(std::size_t{frame->width} * frame->height, 6000);
    }
    frame->step = 2 * frame->width;
    frame->data.resize(2 * pixels_.size());
    std::memcpy(frame->data.mutable_data(), pixels_.data(), frame->data.size());
    if (bad_ && fault == Fault::telemetry) spoil_telemetry(*frame);
    if (bad_ && fault == Fault::malformed) {
      frame->data.resize(draw(39'000));  // too few for any of the sizes below
      frame->width = 160 + (draw(2) == 0 ? draw(1U << 31U) : 0);
      frame->height = 128 + (draw(2) == 0 ? draw(1U << 31U) : 0);
      frame->step = draw(2) == 0 ? draw(400) : 0xFFFFFFFFU;
      frame->significant_bits = static_cast<std::uint8_t>(draw(256));
    }
    queue("/frame", std::move(frame));
  }

  void spoil_pixels() {
    const auto gain = static_cast<float>(uniform(0.5, 2.0));
    const auto offset = static_cast<float>(uniform(-3000.0, 3000.0));
    for (std::size_t k = 0; k < pixels_.size(); ++k) {
      std::uint16_t& p = pixels_[k];
      switch (fault_) {
        case Fault::noise:
          p = static_cast<std::uint16_t>(random_());
          break;
        case Fault::weak_noise:
          p = static_cast<std::uint16_t>(6000 + draw(5) + draw(5));
          break;
        case Fault::black:
          p = 0;
          break;
        case Fault::saturated:
          p = 65535;
          break;
        case Fault::eight_bit_low:
          p = static_cast<std::uint16_t>(p & 0xFFU);
          break;
        case Fault::eight_bit_high:
          p = static_cast<std::uint16_t>(p & 0xFF00U) + static_cast<std::uint16_t>(draw(4) << 8U);
          break;
        case Fault::blocks:
          if ((k / 160 / 16 + k % 160 / 16) % 2 == 0) p = static_cast<std::uint16_t>(draw(2) * 65535);
          break;
        case Fault::inverted:
          p = static_cast<std::uint16_t>(12'000 - std::min<int>(p, 12'000));
          break;
        case Fault::dead_pixels:
          if (draw(20) == 0) p = static_cast<std::uint16_t>(draw(2) * 65535);
          break;
        case Fault::gain_jump:
          p = static_cast<std::uint16_t>(
              std::clamp(6000.0F + offset + gain * (static_cast<float>(p) - 6000.0F), 0.0F, 65535.0F));
          break;
        default:
          return;
      }
    }
  }

  void spoil_telemetry(ThermalFrame& frame) {
    const auto wild = [this] { return static_cast<float>(draw(3) == 0 ? nan : uniform(-1e9, 1e9)); };
    frame.integration_time = draw(2) == 0 ? wild() : static_cast<float>(uniform(0.0, 0.1));
    frame.readout_time = draw(2) == 0 ? wild() : static_cast<float>(uniform(0.0, 0.1));
    frame.radiometric_scale = wild();
    frame.radiometric_offset = wild();
    frame.focal_plane_temperature = wild();
    frame.time_since_ffc = wild();
    frame.ffc_state = static_cast<std::uint8_t>(draw(256));
    frame.significant_bits = static_cast<std::uint8_t>(draw(20));
    frame.frame_counter = static_cast<std::uint32_t>(random_());
  }

  void judge() {
    if (bad_) {
      ++of_fault().frames;
      of_fault().measured += measured_ ? 1 : 0;
      figures_.false_motion += measured_ && shows_nothing(fault_) ? 1 : 0;
      return;
    }
    ++figures_.good;
    ++since_fault_;
    figures_.good_measured += measured_ ? 1 : 0;
    if (!measured_) return;
    if (!recovered_ && of_fault().episodes > 0) {
      recovered_ = true;
      ++of_fault().recovered;
      of_fault().longest = std::max(of_fault().longest, since_fault_);
      of_fault().sum_recovery += since_fault_;
    }
    if (since_fault_ <= 10 || !published_) return;
    const Pose step = TestLap::pose_at(last_position_).inverse() * TestLap::pose_at(position_);
    const double error = std::abs(speed_ - step.translation().z() / (1e-9 * static_cast<double>(period_ns)));
    figures_.measured_wrong += error > 0.5 && error > 10.0 * speed_sigma_ ? 1 : 0;
  }

  TestLap lap_;
  int frames_;
  std::mt19937 random_;
  std::vector<OfflineMessage> queue_;
  std::size_t at_ = 0;
  FuzzFigures figures_;

  Time arrival_{Duration(1'000'000'000'000)};
  std::int64_t clock_ns_ = 1'700'000'000'000'000'000;
  int position_ = 0, last_position_ = 0, shown_ = 0;
  std::vector<std::uint16_t> pixels_;
  std::vector<Fault> order_;
  Fault fault_ = Fault::noise;
  bool bad_ = true;                          // so that it begins with a good stretch
  int left_ = 0, frames_left_at_start_ = 0;  // of the stretch
  int since_fault_ = 0;
  bool recovered_ = false;

  bool published_ = false, measured_ = false;
  double speed_ = 0.0, speed_sigma_ = 0.0;
};

Value::List numbers(const Pose& pose) {
  const std::array<double, 7> v = numbers_of(pose);
  return Value::List(v.begin(), v.end());
}

}  // namespace

std::string_view to_string(Fault fault) {
  return names[static_cast<std::size_t>(fault)];
}

Result<FuzzFigures> run_fuzzed_component_drive(int frames, std::uint32_t seed) {
  ComponentConfig config;
  config.type = config.name = "thermal_odometry";
  config.log_level = LogLevel::off;
  Pose body_from_camera = Pose::Identity();
  body_from_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  config.parameters = Value(Value::Map{{"thermal_pose", numbers(body_from_camera)},
                                       {"lidar_pose", numbers(body_from_camera * TestScene::extrinsics())}});
  auto runner = OfflineRunner::build({config});
  if (!runner) return runner.error();
  FuzzedDrive drive(frames, seed);
  (*runner)->tap("/odometry",
                 [&drive](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
                   drive.on_odometry(*static_cast<const Odometry*>(message.get()));
                 });
  (*runner)->tap("/health",
                 [&drive](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
                   drive.on_health(*static_cast<const ThermalHealth*>(message.get()));
                 });
  const auto done = (*runner)->run(drive);
  if (!done) return done.error();
  return drive.figures();
}

void print(const FuzzFigures& figures) {
  std::printf("%d frames, good %d, measured %d (%.1f %%), wrong %d, not finite %d, false motion %d\n", figures.frames,
              figures.good, figures.good_measured, 100.0 * figures.good_measured / std::max(1, figures.good),
              figures.measured_wrong, figures.not_finite, figures.false_motion);
  for (int i = 0; i < fault_count; ++i) {
    const auto& f = figures.faults[static_cast<std::size_t>(i)];
    std::printf("%-15s %5d episodes %6d frames %6d measured, recovered %5d, after %.1f good frames, at most %d\n",
                to_string(static_cast<Fault>(i)).data(), f.episodes, f.frames, f.measured, f.recovered,
                f.sum_recovery / std::max(1, f.recovered), f.longest);
  }
}

}  // namespace adit::thermal_odometry
