#include <filesystem>

#include "bringup/offline/source.hpp"
#include "components/dataset/cloud_folder.hpp"
#include "components/dataset_player/recorded_messages.hpp"
#include "components/geometry/trajectory.hpp"

namespace adit::offline {
namespace {

class FolderSource final : public Source {
 public:
  FolderSource(dataset::Dataset dataset, Trajectory truth, std::int64_t end_ns)
      : dataset_(std::move(dataset)), truth_(std::move(truth)), end_ns_(end_ns) {}

  Time begin() const override { return Time(Duration(dataset_.entries.front().stamp_ns)); }
  Time end() const override { return Time(Duration(end_ns_)); }

  Result<bool> next(OfflineMessage& out) override {
    const bool clouds_left = next_ < dataset_.entries.size() && dataset_.entries[next_].stamp_ns <= end_ns_;
    const bool truth_left = next_truth_ < truth_.size() && truth_[next_truth_].stamp_ns <= end_ns_;
    if (!clouds_left && !truth_left) return false;
    if (truth_left && (!clouds_left || truth_[next_truth_].stamp_ns <= dataset_.entries[next_].stamp_ns)) {
      const StampedPose& pose = truth_[next_truth_++];
      auto message = std::make_shared<nav_msgs::msg::Odometry>();
      dataset_player::fill(pose, "map", "base_link", *message);
      out = offline_message<nav_msgs::msg::Odometry>("/ground_truth/odometry", Time(Duration(pose.stamp_ns)),
                                                     std::move(message));
      return true;
    }
    const Time stamp{Duration(dataset_.entries[next_].stamp_ns)};
    const Result<dataset::PointFile> file = dataset::read_cloud(dataset_, next_++);
    if (!file) return file.error();
    auto message = std::make_shared<sensor_msgs::msg::PointCloud2>();
    dataset_player::fill(*file, stamp, "lidar", *message);
    out = offline_message<sensor_msgs::msg::PointCloud2>("/lidar/points", stamp, std::move(message));
    return true;
  }

 private:
  dataset::Dataset dataset_;
  Trajectory truth_;
  std::int64_t end_ns_;
  std::size_t next_ = 0, next_truth_ = 0;
};

}  // namespace

Result<std::unique_ptr<Source>> open_folder(const std::string& path, const SourceOptions& options) {
  Result<dataset::Dataset> dataset = dataset::open_clouds(path, 10.0);
  if (!dataset) return dataset.error();
  Trajectory truth;
  const std::filesystem::path truth_file = std::filesystem::path(path) / "gt_base.tum";
  if (options.topics.contains("/ground_truth/odometry") && std::filesystem::exists(truth_file)) {
    Result<Trajectory> read = read_tum(truth_file.string());
    if (!read) return read.error();
    truth = *std::move(read);
  }
  std::int64_t end_ns = dataset->entries.back().stamp_ns;
  if (options.duration_s > 0.0) {
    end_ns = std::min(end_ns, dataset->entries.front().stamp_ns + static_cast<std::int64_t>(1e9 * options.duration_s));
  }
  return std::unique_ptr<Source>(new FolderSource(*std::move(dataset), std::move(truth), end_ns));
}

}  // namespace adit::offline
