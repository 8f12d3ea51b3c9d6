#include "bringup/commands/thermal_folder.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "bringup/commands/rig_file.hpp"
#include "components/dataset/cloud_folder.hpp"
#include "components/dataset_player/recorded_messages.hpp"
#include "components/runtime/stamp.hpp"

namespace adit {
namespace {

namespace fs = std::filesystem;
using adit_msgs::msg::ThermalFrame;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::PointCloud2;

Value::List list_of(std::span<const double> numbers) {
  return Value::List(numbers.begin(), numbers.end());
}

// calib.txt: fx fy cx cy width height; then, on a second line, the distortion coefficients.
Result<void> read_calibration(const fs::path& path, ThermalFolder& folder) {
  std::ifstream file(path);
  std::string first, second;
  std::getline(file, first);
  std::getline(file, second);
  std::istringstream fields(first);
  std::array<double, 4> matrix{};
  std::int64_t width = 0, height = 0;
  for (double& value : matrix) fields >> value;
  if (!(fields >> width >> height)) {
    return Error{ErrorCode::malformed, path.string() + ":1: fx fy cx cy width height are wanted"};
  }
  std::vector<double> distortion;
  std::istringstream rest(second);
  for (double value = 0.0; rest >> value;) distortion.push_back(value);
  folder.parameters.emplace_back("camera_matrix", list_of(matrix));
  folder.parameters.emplace_back("image_size", Value::List{width, height});
  if (!distortion.empty()) folder.parameters.emplace_back("distortion", list_of(distortion));
  return {};
}

Result<void> read_rig(const fs::path& path, ThermalFolder& folder) {
  const Result<RigFile> rig = read_rig_file(path.string());
  if (!rig) return rig.error();
  for (const auto& [name, value] : rig->numbers) {
    if (name == "thermal_row_time") folder.row_time = value;
    if (name == "thermal_time_constant") folder.time_constant = value;
  }
  for (const auto& [matrix, parameter] :
       {std::pair{"T_base_thermal", "thermal_pose"}, {"T_base_lidar", "lidar_pose"}}) {
    if (const auto pose = rig->poses.find(matrix); pose != rig->poses.end()) {
      folder.parameters.emplace_back(parameter, pose_parameter(pose->second));
    }
  }
  return {};
}

}  // namespace

Result<ThermalFolder> open_thermal_folder(const std::string& path, double rate_hz) {
  ThermalFolder folder;
  Result<dataset::Dataset> images = dataset::open_images(path, rate_hz);
  if (!images) return images.error();
  folder.images = *std::move(images);
  const fs::path root(path);
  if (fs::exists(root / "scans" / "index.txt")) {
    Result<dataset::Dataset> clouds = dataset::open_dataset(path, rate_hz);
    if (!clouds) return clouds.error();
    folder.clouds = *std::move(clouds);
  }
  if (fs::exists(root / "calib.txt")) {
    if (Result<void> read = read_calibration(root / "calib.txt", folder); !read) return read.error();
  }
  if (fs::exists(root / "extrinsics.yaml")) {
    if (Result<void> read = read_rig(root / "extrinsics.yaml", folder); !read) return read.error();
  }
  return folder;
}

ThermalFolderSource::ThermalFolderSource(ThermalFolder folder, Trajectory prior)
    : folder_(std::move(folder)), prior_(std::move(prior)) {}

Result<bool> ThermalFolderSource::next(OfflineMessage& out) {
  if (handed_out_) {
    const std::chrono::duration<double, std::milli> spent = Steady::now() - *handed_out_;
    timing_.push_back({folder_.images.entries[next_frame_ - 1].stamp_ns, spent.count()});
    handed_out_.reset();
  }
  if (next_frame_ == frames()) return false;
  const std::int64_t frame_ns = folder_.images.entries[next_frame_].stamp_ns;
  if (!cloud_ && next_cloud_ < folder_.clouds.entries.size() &&
      folder_.clouds.entries[next_cloud_].stamp_ns <= frame_ns) {
    if (Result<void> read = read_cloud(); !read) return read.error();
  }
  const std::int64_t cloud_ns = cloud_ ? cloud_->stamp.time_since_epoch().count() : INT64_MAX;
  if (next_prior_ < prior_.size() && prior_[next_prior_].stamp_ns <= std::min(frame_ns, cloud_ns)) {
    const StampedPose& pose = prior_[next_prior_];
    auto message = std::make_shared<Odometry>();
    dataset_player::fill(pose, "odom", "base_link", *message);
    if (next_prior_ > 0) {
      const StampedPose& before = prior_[next_prior_ - 1];
      const double dt = 1e-9 * static_cast<double>(pose.stamp_ns - before.stamp_ns);
      const Vector6d twist = se3_log(before.pose.inverse() * pose.pose) / dt;
      message->twist.twist.linear = {twist[0], twist[1], twist[2]};
      message->twist.twist.angular = {twist[3], twist[4], twist[5]};
    }
    out = offline_message<Odometry>("/prior", Time(Duration(pose.stamp_ns)), std::move(message));
    ++next_prior_;
    return true;
  }
  if (cloud_ns <= frame_ns) {
    out = std::move(*cloud_);
    cloud_.reset();
    return true;
  }
  if (Result<void> read = read_frame(out); !read) return read.error();
  return true;
}

Result<void> ThermalFolderSource::read_cloud() {
  const dataset::Entry& entry = folder_.clouds.entries[next_cloud_];
  const Result<dataset::PointFile> file = dataset::read_cloud(folder_.clouds, next_cloud_++);
  if (!file) return file.error();
  auto message = std::make_shared<PointCloud2>();
  dataset_player::fill(*file, Time(Duration(entry.stamp_ns)), "lidar", *message);
  double last = 0.0;
  const std::size_t columns = file->fields.size();
  constexpr std::size_t time_column = 4;
  for (std::size_t i = 0; columns > time_column && i < file->points; ++i) {
    last = std::max(last, static_cast<double>(file->values[i * columns + time_column]));
  }
  const Time over(Duration(entry.stamp_ns + std::llround(1e9 * std::min(last, 1.0))));
  cloud_ = offline_message<PointCloud2>("/points", over, std::move(message));
  return {};
}

Result<void> ThermalFolderSource::read_frame(OfflineMessage& out) {
  const dataset::Entry& entry = folder_.images.entries[next_frame_];
  const Result<dataset::Image16> image = dataset::read_png16(entry.path);
  if (!image) return image.error();
  const double readout = folder_.row_time * image->height;
  const Time first_row(Duration(entry.stamp_ns - std::llround(0.5e9 * readout)));
  auto message = std::make_shared<ThermalFrame>();
  dataset_player::fill(*image, first_row, "thermal_optical", static_cast<std::uint32_t>(next_frame_), *message);
  if (readout > 0.0) message->readout_time = static_cast<float>(readout);
  if (folder_.time_constant > 0.0) message->integration_time = static_cast<float>(folder_.time_constant);
  out = offline_message<ThermalFrame>("/frame", Time(Duration(entry.stamp_ns)), std::move(message));
  ++next_frame_;
  show_progress();
  handed_out_ = Steady::now();
  return {};
}

void ThermalFolderSource::show_progress() const {
  if (!::isatty(STDERR_FILENO)) return;
  std::fprintf(stderr, "\r%zu of %zu frames%s", next_frame_, frames(), next_frame_ == frames() ? "\n" : "");
}

}  // namespace adit
