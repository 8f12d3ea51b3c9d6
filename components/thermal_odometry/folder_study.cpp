// thermal_odometry_folder_study FOLDER [--mono] [--yaw DEG] [--time-offset S] [--no-lidar FROM:TO] [--no-bilateral]
//   [--no-window] [--global-shutter] [--prior SIGMA_V] [--ffc EVERY:LENGTH]: a simulated folder
//   (components/tunnel_simulator/README.md)
// through the library, one line of figures against its truth.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <optional>
#include <random>

#include <Eigen/Cholesky>

#include "components/thermal_odometry/test_data.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {
namespace {

struct Options {
  std::string folder;
  bool mono = false, bilateral = true, window = true, rolling = true;
  double yaw_deg = 0.0, time_offset = 0.0;
  double outage_from = 1e18, outage_to = 1e18;  // s since the first frame
  double prior_sigma = 0.0;                     // m/s, of a prior made from the truth; 0: none
  double ffc_every = 0.0, ffc_length = 0.0;     // s, of a shutter closed without a word; 0: never
};

struct Scan {
  std::string file;
  std::int64_t stamp_ns = 0;
  std::size_t points = 0;
};

struct Folder {
  CameraModel camera;
  double time_constant = 0.0;
  Pose T_base_camera = Pose::Identity();
  Pose T_camera_lidar = Pose::Identity();
  std::vector<std::int64_t> stamps;
  std::vector<Scan> scans;
  Trajectory truth;  // of the camera
};

Pose read_pose(std::istream& in) {
  Pose pose = Pose::Identity();
  std::string line;
  for (int r = 0; r < 4 && std::getline(in, line); ++r) {
    auto& m = pose.matrix();
    std::sscanf(line.c_str(), " - [%lf, %lf, %lf, %lf]", &m(r, 0), &m(r, 1), &m(r, 2), &m(r, 3));
  }
  return pose;
}

std::optional<Folder> open(const std::filesystem::path& path) {
  Folder folder;
  CameraModel& c = folder.camera;
  std::ifstream calibration(path / "calib.txt");
  if (!(calibration >> c.fx >> c.fy >> c.cx >> c.cy >> c.width >> c.height)) return std::nullopt;
  std::ifstream rig(path / "extrinsics.yaml");
  for (std::string line; std::getline(rig, line);) {
    if (line.starts_with("T_base_thermal:")) folder.T_base_camera = read_pose(rig);
    if (line.starts_with("T_thermal_lidar:")) folder.T_camera_lidar = read_pose(rig);
    std::sscanf(line.c_str(), "thermal_row_time: %lf", &c.row_time);
    std::sscanf(line.c_str(), "thermal_time_constant: %lf", &folder.time_constant);
  }
  std::ifstream times(path / "times.txt");
  double index = 0.0, stamp = 0.0;
  while (times >> index >> stamp) folder.stamps.push_back(std::llround(1e9 * stamp));
  std::ifstream scans(path / "scans" / "index.txt");
  for (std::string line; std::getline(scans, line);) {
    Scan scan;
    if (std::istringstream(line) >> scan.file >> scan.stamp_ns >> scan.points) folder.scans.push_back(scan);
  }
  // The body's truth at 100 Hz: that of the camera, once a frame, is too coarse for a trot.
  const auto base = read_tum((path / "gt_base.tum").string());
  if (!base) return std::nullopt;
  for (const StampedPose& p : *base) folder.truth.push_back({p.stamp_ns, p.pose * folder.T_base_camera});
  return folder;
}

double cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

// Silent flat-field corrections: the last picture again and again, then another offset (+-1.5 K of 50 counts) and
// another fixed pattern (30 mK).
class Shutter {
 public:
  Shutter(double every, double length) : every_(every), length_(length), pattern_(1U << 16U) {
    std::mt19937 random(7);
    std::normal_distribution<float> normal(0.0F, 1.5F);
    for (float& value : pattern_) value = normal(random);
  }
  // Changes the picture of time `t` [s].
  void apply(double t, Recorded& image) {
    if (every_ <= 0.0) return;
    const int event = static_cast<int>(t / every_);
    closed_ = event > 0 && t - every_ * event < length_;
    if (closed_ && event != event_) {
      event_ = event;
      ++events;
      since_ = 0;
    }
    if (closed_) {
      image = last_;
      return;
    }
    if (event_ > 0) {
      const float offset = event_ % 2 == 0 ? 75.0F : -75.0F;
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const float value = static_cast<float>(image.pixels[i]) + offset +
                            pattern_[(i * 7919U + static_cast<std::size_t>(event_) * 104729U) & 0xFFFFU];
        image.pixels[i] = static_cast<std::uint16_t>(std::clamp(value + 0.5F, 0.0F, 65535.0F));
      }
    }
    last_ = image;
  }
  void note(bool measured) {
    if (event_ == 0) return;
    frozen += closed_ ? 1 : 0;
    frozen_measured += closed_ && measured ? 1 : 0;
    if (closed_ || since_ < 0) return;
    ++since_;
    if (!measured) return;
    longest = std::max(longest, since_);
    ++recovered;
    since_ = -1;
  }
  int events = 0, frozen = 0, frozen_measured = 0, recovered = 0, longest = 0;

 private:
  double every_, length_;
  bool closed_ = false;
  int event_ = 0;
  int since_ = -1;  // live frames since the last event; -1: measured again
  Recorded last_;
  std::vector<float> pattern_;
};

struct Mean {
  double sum = 0.0;
  int n = 0;
  void add(double value) { sum += value, ++n; }
  double get() const { return n > 0 ? sum / n : 0.0; }
};

// How the errors of the motion over `lag` frames compare with the sum of the steps' covariances, direction by direction
// (right increment in camera axes: x right, y down, z ahead; then the turns about them): 1 is honest.
void print_consistency(const std::vector<Pose>& estimates, const std::vector<Pose>& truths,
                       const std::vector<Matrix6d>& steps, std::size_t lag) {
  Vector6d normalised = Vector6d::Zero(), squares = Vector6d::Zero(), variances = Vector6d::Zero();
  double whole = 0.0;
  int n = 0;
  for (std::size_t i = 0; i + lag < estimates.size(); i += std::max<std::size_t>(1, lag / 3), ++n) {
    const Pose estimated = estimates[i].inverse() * estimates[i + lag];
    const Vector6d error = se3_log((truths[i].inverse() * truths[i + lag]).inverse() * estimated);
    Matrix6d covariance = Matrix6d::Zero();
    for (std::size_t k = i + 1; k <= i + lag; ++k) {
      const Matrix6d carry = se3_adjoint(estimates[i + lag].inverse() * estimates[k]);
      covariance += carry * steps[k] * carry.transpose();
    }
    normalised += (error.array().square() / covariance.diagonal().array()).matrix();
    squares += error.cwiseAbs2();
    variances += covariance.diagonal();
    whole += error.dot(covariance.ldlt().solve(error)) / 6.0;
  }
  if (n == 0) return;
  const auto rms = [n](double sum) { return 1e3 * std::sqrt(sum / n); };
  std::printf("  NEES/dof over %3zu frames %6.2f; by direction (error/sigma, mm or mrad):", lag, whole / n);
  for (int d = 0; d < 6; ++d) std::printf(" %.2f (%.2f/%.2f)", normalised[d] / n, rms(squares[d]), rms(variances[d]));
  std::printf("\n");
}

// How long the last steps came out without LiDAR, every 20 m, against the deviation stated.
class ScaleWatch {
 public:
  void add(double estimated, double exact, double sigma) {
    way_ += exact;
    estimated_ += estimated;
    exact_ += exact;
    if (exact_ < 10.0) return;
    last_ = std::log(exact_ / std::max(1e-6, estimated_));
    estimated_ = exact_ = 0.0;
    if (way_ < 20.0 * static_cast<double>(lines_.size() + 1)) return;
    lines_.push_back({way_, last_, sigma});
  }
  void print() const {
    if (lines_.empty()) return;
    std::printf("  scale without LiDAR, off %% (sigma) after so many metres:");
    for (const auto& [way, error, sigma] : lines_)
      std::printf(" %+.2f (%.2f) %.0f;", 100.0 * error, 100.0 * sigma, way);
    std::printf("\n");
  }

 private:
  struct Line {
    double way, error, sigma;
  };
  double way_ = 0.0, estimated_ = 0.0, exact_ = 0.0, last_ = 0.0;
  std::vector<Line> lines_;
};

int study(const Options& options) {
  const std::filesystem::path path(options.folder);
  std::optional<Folder> folder = open(path);
  if (!folder || folder->stamps.empty()) {
    std::fprintf(stderr, "%s: not a simulated folder\n", options.folder.c_str());
    return 1;
  }
  if (!options.rolling) folder->camera.row_time = 0.0;
  Config config;
  config.mode = options.mono ? Mode::mono : Mode::anchored;
  config.front_end.bilateral = options.bilateral;
  config.mapper.optimise = options.window;
  const auto odometry = ThermalOdometry::create(folder->camera, config);
  if (!odometry) {
    std::fprintf(stderr, "%s\n", odometry.error().message.c_str());
    return 1;
  }
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Pose> estimates, truths;
  std::vector<double> seconds;
  std::vector<Matrix6d> steps;  // covariances
  std::vector<Eigen::Vector3f> points;
  std::vector<float> offsets, values;
  Mean frame_ms, keyframe_ms;
  ScaleWatch scale_watch;
  Shutter shutter(options.ffc_every, options.ffc_length);
  std::size_t next_scan = 0;
  std::int64_t last_ns = 0;
  int first = -1;
  double path_length = 0.0, error = 0.0, outage_path = -1.0, outage_error = 0.0, outage = -1.0;
  for (std::size_t i = 0; i < folder->stamps.size(); ++i) {
    const double t = 1e-9 * static_cast<double>(folder->stamps[i] - folder->stamps[0]);
    Recorded image = read_frame(path, static_cast<int>(i));
    shutter.apply(t, image);
    const Frame frame = image.at(folder->stamps[i] - std::llround(1e9 * folder->time_constant));
    bool has_cloud = false;
    DepthPoints cloud;
    for (; next_scan < folder->scans.size(); ++next_scan) {
      const Scan& scan = folder->scans[next_scan];
      if (scan.stamp_ns + 100'000'000 > folder->stamps[i]) break;  // its sweep is not over
      if (t >= options.outage_from && t < options.outage_to) continue;
      values.resize(6 * scan.points);
      std::ifstream file(path / "scans" / scan.file, std::ios::binary);
      file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(4 * values.size()));
      points.clear();
      offsets.clear();
      for (std::size_t k = 0; k < values.size(); k += 6) {
        points.emplace_back(values[k], values[k + 1], values[k + 2]);
        offsets.push_back(values[k + 4]);
      }
      cloud = {points, offsets, scan.stamp_ns + std::llround(1e9 * options.time_offset), folder->T_camera_lidar};
      cloud.T_camera_sensor.linear() =
          so3_exp(Eigen::Vector3d(0.0, options.yaw_deg * M_PI / 180.0, 0.0)) * cloud.T_camera_sensor.linear();
      has_cloud = true;
    }
    const std::optional<Pose> truth = interpolate(folder->truth, frame.stamp_ns);
    std::optional<Prior> prior;
    if (options.prior_sigma > 0.0 && last_ns != 0 && truth) {
      const double dt = 1e-9 * static_cast<double>(frame.stamp_ns - last_ns);
      prior.emplace();
      prior->T_previous_current = interpolate(folder->truth, last_ns)->inverse() * *truth;
      prior->T_previous_current.translation().z() += options.prior_sigma * dt * normal(random);
      prior->covariance = std::pow(options.prior_sigma * dt, 2.0) * Matrix6d::Identity();
    }
    const double begin = cpu_ms();
    const Estimate& estimate = (*odometry)->process(frame, prior ? &*prior : nullptr, has_cloud ? &cloud : nullptr);
    (estimate.new_keyframe ? keyframe_ms : frame_ms).add(cpu_ms() - begin);
    shutter.note(estimate.measured);
    if (!estimate.measured || !truth) continue;
    last_ns = frame.stamp_ns;
    if (first < 0) first = static_cast<int>(i) + 1;
    if (!truths.empty() && t >= options.outage_from && t < options.outage_to && estimate.scale == ScaleState::carried) {
      scale_watch.add((estimates.back().inverse() * estimate.T_odom_camera).translation().norm(),
                      (truths.back().inverse() * *truth).translation().norm(), estimate.log_scale_sigma);
    }
    if (!truths.empty()) path_length += (truth->translation() - truths.back().translation()).norm();
    estimates.push_back(estimate.T_odom_camera);
    truths.push_back(*truth);
    steps.push_back(estimate.step_covariance);
    seconds.push_back(t);
    error = ((estimates[0].inverse() * estimates.back()).translation() -
             (truths[0].inverse() * truths.back()).translation())
                .norm();
    if (outage_path < 0.0 && t >= options.outage_from) outage_path = path_length, outage_error = error;
    if (outage < 0.0 && t >= options.outage_to)
      outage = 100.0 * std::abs(error - outage_error) / (path_length - outage_path);
  }
  const Counters& counters = (*odometry)->estimate().counters;
  std::printf("%s measured %zu/%zu, first at frame %d, failed %llu, restarts %llu\n", options.folder.c_str(),
              estimates.size(), folder->stamps.size(), first, static_cast<unsigned long long>(counters.failed),
              static_cast<unsigned long long>(counters.restarts));
  if (estimates.size() < 30) return 0;
  const Alignment similar = align(estimates, truths, true);
  const Alignment rigid = align(estimates, truths, false);
  double rotation = 0.0;
  const double segment = std::min(50.0, 0.5 * path_length);
  const double drift = relative_error(estimates, truths, segment, options.mono ? similar.scale : 1.0, &rotation);
  double squares = 0.0, estimated = 0.0, exact = 0.0;
  int n = 0;
  for (std::size_t k = 6; k < estimates.size(); k += 6, ++n) {
    const double e = (estimates[k].translation() - estimates[k - 6].translation()).norm();
    const double x = (truths[k].translation() - truths[k - 6].translation()).norm();
    estimated += e;
    exact += x;
    squares += std::pow((e - x) / (seconds[k] - seconds[k - 6]), 2.0);
  }
  std::printf(
      "  path %.1f m, end %.3f %%, drift per %.0f m %.3f %%, rotation %.2f deg/100m, length %+.3f %%, speed rms %.3f "
      "m/s\n"
      "  Sim3 ATE %.3f m = %.3f %% (scale %.4f), SE3 ATE %.3f %%, %.2f keyframes/s, CPU ms frame %.1f keyframe %.1f\n",
      path_length, 100.0 * error / path_length, segment, 100.0 * drift, rotation, 100.0 * (estimated / exact - 1.0),
      std::sqrt(squares / std::max(1, n)), similar.rmse, 100.0 * similar.rmse / path_length, similar.scale,
      100.0 * rigid.rmse / path_length, static_cast<double>(counters.keyframes) / (seconds.back() - seconds.front()),
      frame_ms.get(), keyframe_ms.get());
  const Eigen::Vector3d turned = 180.0 / M_PI *
                                 so3_log((truths[0].inverse() * truths.back()).rotation().transpose() *
                                         (estimates[0].inverse() * estimates.back()).rotation());
  std::printf("  turned too far at the end: pitch %+.3f yaw %+.3f roll %+.3f deg\n", turned.x(), turned.y(),
              turned.z());
  if (!options.mono) {
    const Estimate& last = (*odometry)->estimate();
    const Eigen::Vector3d found = 180.0 / M_PI * last.boresight;
    const Eigen::Vector3d sigma = 180.0 / M_PI * last.boresight_covariance.diagonal().cwiseSqrt();
    std::printf("  boresight [deg]: %+.3f (sigma %.3f) %+.3f (%.3f) %+.3f (%.3f)\n", found.x(), sigma.x(), found.y(),
                sigma.y(), found.z(), sigma.z());
  }
  if (shutter.events > 0) {
    std::printf(
        "  FFC: %d events, %d frozen frames, %d of them measured; %d recovered, at the latest with live frame %d\n",
        shutter.events, shutter.frozen, shutter.frozen_measured, shutter.recovered, shutter.longest);
  }
  if (!options.mono) {
    for (std::size_t lag : {1, 6, 30, 150}) print_consistency(estimates, truths, steps, lag);
  }
  scale_watch.print();
  if (outage >= 0.0) std::printf("  without LiDAR: %.2f %% of its way\n", outage);
  return 0;
}

}  // namespace
}  // namespace adit::thermal_odometry

int main(int count, char** arguments) {
  adit::thermal_odometry::Options options;
  for (int i = 1; i < count; ++i) {
    const std::string name = arguments[i];
    const auto value = [&] { return i + 1 < count ? std::string(arguments[++i]) : std::string(); };
    if (name == "--mono") {
      options.mono = true;
    } else if (name == "--no-bilateral") {
      options.bilateral = false;
    } else if (name == "--no-window") {
      options.window = false;
    } else if (name == "--global-shutter") {
      options.rolling = false;
    } else if (name == "--yaw") {
      options.yaw_deg = std::atof(value().c_str());
    } else if (name == "--time-offset") {
      options.time_offset = std::atof(value().c_str());
    } else if (name == "--prior") {
      options.prior_sigma = std::atof(value().c_str());
    } else if (name == "--ffc") {
      std::sscanf(value().c_str(), "%lf:%lf", &options.ffc_every, &options.ffc_length);
    } else if (name == "--no-lidar") {
      std::sscanf(value().c_str(), "%lf:%lf", &options.outage_from, &options.outage_to);
    } else {
      options.folder = name;
    }
  }
  return adit::thermal_odometry::study(options);
}
