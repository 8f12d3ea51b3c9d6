#include "bringup/commands/lidar_recording.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "bringup/commands/rig_file.hpp"
#include "components/dataset/bag_reader.hpp"
#include "components/dataset/cloud_folder.hpp"
#include "components/dataset_player/recorded_messages.hpp"
#include "components/runtime/stamp.hpp"
#include "sensor_msgs/msg/imu.hpp"

namespace adit {
namespace {

namespace fs = std::filesystem;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::Imu;
using sensor_msgs::msg::PointCloud2;

constexpr const char* clouds_topic = "/points";
constexpr const char* imu_topic = "/imu";

Time time_of(std::int64_t stamp_ns) {
  return Time(Duration(stamp_ns));
}

// "stamp,ax,ay,az,gx,gy,gz" a line; '#' starts a comment.
Result<std::vector<std::shared_ptr<const Imu>>> read_imu(const std::string& path) {
  std::vector<std::shared_ptr<const Imu>> samples;
  std::ifstream file(path);
  if (!file) return Error{ErrorCode::io, path + ": cannot be read"};
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    long long stamp_ns = 0;
    double a[3], w[3];
    if (std::sscanf(line.c_str(), "%lld,%lf,%lf,%lf,%lf,%lf,%lf", &stamp_ns, &a[0], &a[1], &a[2], &w[0], &w[1],
                    &w[2]) != 7) {
      return Error{ErrorCode::malformed, path + ":" + std::to_string(number) + ": stamp,ax,ay,az,gx,gy,gz are wanted"};
    }
    auto sample = std::make_shared<Imu>();
    sample->header.stamp = to_stamp(time_of(stamp_ns));
    sample->header.frame_id = "imu";
    sample->orientation_covariance[0] = -1.0;
    sample->linear_acceleration = {a[0], a[1], a[2]};
    sample->angular_velocity = {w[0], w[1], w[2]};
    samples.push_back(std::move(sample));
  }
  return samples;
}

class FolderRecording final : public LidarRecording {
 public:
  FolderRecording(dataset::Dataset dataset, Trajectory prior, std::vector<std::shared_ptr<const Imu>> imu,
                  Value::Map parameters)
      : dataset_(std::move(dataset)),
        prior_(std::move(prior)),
        imu_(std::move(imu)),
        parameters_(std::move(parameters)) {}

  Value::Map parameters() const override { return parameters_; }
  bool has_imu() const override { return !imu_.empty(); }

 private:
  Result<bool> read(OfflineMessage& out) override {
    const bool clouds_left = next_ < dataset_.entries.size();
    if (next_imu_ < imu_.size()) {
      const Time stamp = to_time(imu_[next_imu_]->header.stamp);
      if (!clouds_left || stamp <= time_of(dataset_.entries[next_].stamp_ns)) {
        out = offline_message<Imu>(imu_topic, stamp, imu_[next_imu_++]);
        return true;
      }
    }
    if (!clouds_left) return false;
    const dataset::Entry& entry = dataset_.entries[next_];
    const Time stamp = time_of(entry.stamp_ns);
    if (const std::optional<Pose> pose = interpolate(prior_, entry.stamp_ns); pose && !prior_sent_) {
      auto message = std::make_shared<Odometry>();
      dataset_player::fill(StampedPose{entry.stamp_ns, *pose}, "odom", "lidar", *message);
      out = offline_message<Odometry>("/prior", stamp, std::move(message));
      prior_sent_ = true;
      return true;
    }
    const Result<dataset::PointFile> file = dataset::read_cloud(dataset_, next_);
    if (!file) return file.error();
    auto message = std::make_shared<PointCloud2>();
    dataset_player::fill(*file, stamp, "lidar", *message);
    out = offline_message<PointCloud2>(clouds_topic, stamp, std::move(message));
    ++next_;
    prior_sent_ = false;
    show_progress();
    return true;
  }

  void show_progress() const {
    if (!::isatty(STDERR_FILENO)) return;
    const std::size_t total = dataset_.entries.size();
    std::fprintf(stderr, "\r%zu of %zu files%s", next_, total, next_ == total ? "\n" : "");
  }

  dataset::Dataset dataset_;
  Trajectory prior_;
  std::vector<std::shared_ptr<const Imu>> imu_;
  Value::Map parameters_;
  std::size_t next_ = 0, next_imu_ = 0;
  bool prior_sent_ = false;
};

class BagRecording final : public LidarRecording {
 public:
  BagRecording(std::unique_ptr<dataset::BagReader> reader, std::string clouds, std::string imu)
      : reader_(std::move(reader)), clouds_(std::move(clouds)), imu_(std::move(imu)) {}

  Value::Map parameters() const override { return {}; }
  bool has_imu() const override { return !imu_.empty(); }

 private:
  Result<bool> read(OfflineMessage& out) override {
    dataset::BagSample sample;
    const Result<bool> more = reader_->next(sample);
    if (!more || !*more) return more;
    out = OfflineMessage{};
    out.topic = reader_->info().topics[sample.topic].name == clouds_ ? clouds_topic : imu_topic;
    out.stamp = time_of(sample.stamp_ns);
    out.cdr = sample.cdr;  // valid until the next call: inputs copy what they need
    return true;
  }

  std::unique_ptr<dataset::BagReader> reader_;
  std::string clouds_, imu_;
};

Result<std::unique_ptr<LidarRecording>> open_bag(const std::string& path) {
  Result<std::unique_ptr<dataset::BagReader>> reader = dataset::BagReader::open(path);
  if (!reader) return reader.error();
  std::string clouds, imu;
  for (const dataset::BagTopic& topic : (*reader)->info().topics) {
    std::string* of_type = topic.type == "sensor_msgs/msg/PointCloud2" ? &clouds
                           : topic.type == "sensor_msgs/msg/Imu"       ? &imu
                                                                       : nullptr;
    if (of_type == nullptr) continue;
    if (!of_type->empty()) {
      return Error{ErrorCode::invalid_argument,
                   path + " has " + *of_type + " and " + topic.name + ": use `adit run-offline` with a deployment"};
    }
    *of_type = topic.name;
  }
  if (clouds.empty()) return Error{ErrorCode::invalid_argument, path + " holds no clouds"};
  std::vector<std::string> topics{clouds};
  if (!imu.empty()) topics.push_back(imu);
  if (Result<void> selected = (*reader)->select(topics); !selected) return selected.error();
  return std::unique_ptr<LidarRecording>(new BagRecording(*std::move(reader), clouds, imu));
}

Result<std::unique_ptr<LidarRecording>> open_folder(const std::string& path, LidarRecordingOptions options) {
  Result<dataset::Dataset> dataset = dataset::open_clouds(path, options.file_rate);
  if (!dataset) return dataset.error();
  std::vector<std::shared_ptr<const Imu>> imu;
  if (!options.imu.empty()) {
    auto read = read_imu(options.imu);
    if (!read) return read.error();
    imu = *std::move(read);
  }
  Value::Map parameters;
  if (const fs::path rig_path = fs::path(path) / "extrinsics.yaml"; fs::exists(rig_path)) {
    const Result<RigFile> rig = read_rig_file(rig_path.string());
    if (!rig) return rig.error();
    for (const auto& [matrix, parameter] : {std::pair{"T_base_lidar", "lidar_pose"}, {"T_base_imu", "imu_pose"}}) {
      if (const auto pose = rig->poses.find(matrix); pose != rig->poses.end()) {
        parameters.emplace_back(parameter, Value(pose_parameter(pose->second)));
      }
    }
  }
  return std::unique_ptr<LidarRecording>(
      new FolderRecording(*std::move(dataset), std::move(options.prior), std::move(imu), std::move(parameters)));
}

}  // namespace

Result<std::unique_ptr<LidarRecording>> LidarRecording::open(const std::string& path, LidarRecordingOptions options) {
  const bool bag = fs::exists(fs::path(path) / "metadata.yaml") || fs::path(path).extension() == ".db3";
  return bag ? open_bag(path) : open_folder(path, std::move(options));
}

Result<bool> LidarRecording::next(OfflineMessage& out) {
  if (handed_out_ && !timing_.empty()) {
    timing_.back().milliseconds += std::chrono::duration<double, std::milli>(Steady::now() - *handed_out_).count();
  }
  const Result<bool> more = read(out);
  if (more && *more && out.topic == clouds_topic) timing_.push_back({out.stamp.time_since_epoch().count(), 0.0});
  handed_out_ = Steady::now();
  return more;
}

}  // namespace adit
