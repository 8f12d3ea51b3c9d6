// The newest LiDAR clouds in the camera frame, and what they look like from where the camera is now.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/thermal_odometry/frame.hpp"

namespace adit::thermal_odometry {

// Poses of the last frames, to move clouds with the estimated motion.
class PoseHistory {
 public:
  void add(std::int64_t stamp_ns, const Pose& T_cw);  // stamps strictly increasing
  void clear() { count_ = 0; }
  // Cubic interpolation; up to 0.2 s beyond the newest by the newest twist; nothing before the oldest.
  std::optional<Pose> at(std::int64_t stamp_ns) const;
  std::size_t size() const { return count_; }

 private:
  struct Entry {
    std::int64_t stamp_ns;
    Pose T_cw;
  };
  Pose curved(std::int64_t stamp_ns, std::size_t age) const;
  const Entry& entry(std::size_t age) const { return ring_[(next_ + ring_.size() - 1 - age) % ring_.size()]; }
  std::array<Entry, 64> ring_;
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

class CloudBuffer {
 public:
  CloudBuffer(std::size_t capacity, double max_age_s);
  // Copies; points that are not finite are dropped, those beyond the capacity are left out evenly.
  void add(const DepthPoints& cloud);
  // Points in the camera frame at `stamp_ns`, from the newest cloud whose last point is at most max_age older and 50 ms
  // newer. Without a history both instants are taken as the same place. Empty: no such cloud. Valid until the next
  // call.
  // `boresight`: turns the points in the camera frame of their own time.
  std::span<const Eigen::Vector3f> at(std::int64_t stamp_ns, const PoseHistory& history,
                                      const Eigen::Matrix3d& boresight = Eigen::Matrix3d::Identity());

 private:
  struct Cloud {
    std::int64_t stamp_ns = 0;
    bool used = false;
    float first_offset_s = 0.0F;
    float last_offset_s = 0.0F;
    std::vector<Eigen::Vector3f> points;  // camera frame at each point's own time
    std::vector<float> offsets_s;
  };
  std::size_t capacity_;
  double max_age_s_;
  std::array<Cloud, 3> clouds_;
  std::size_t next_ = 0;
  std::vector<Eigen::Vector3f> moved_;
};

}  // namespace adit::thermal_odometry
