// LiDAR odometry: the pose of a LiDAR from its sweeps, by registration against a local map it builds itself.
// One object is one odometry. It allocates its workspace as it grows and then keeps it; it logs nothing, reads no clock
// and starts no thread unless Config::threads > 1. Not thread-safe: one caller at a time. Nothing here throws for bad
// input, and no output is ever NaN or infinite except Direction::sigma.
#pragma once

#include <memory>

#include "components/lidar_odometry/cloud.hpp"
#include "components/lidar_odometry/config.hpp"
#include "components/lidar_odometry/estimate.hpp"

namespace adit::lidar_odometry {

struct SweepStamps {
  std::int64_t first_ns, last_ns;  // of its points; the cloud's stamp if it has no usable times
  std::int64_t reference_ns;       // of the pose
};

class LidarOdometry {
 public:
  // Precondition: check(config) succeeds.
  explicit LidarOdometry(const Config& config);
  ~LidarOdometry();
  LidarOdometry(LidarOdometry&&) noexcept;
  LidarOdometry& operator=(LidarOdometry&&) noexcept;

  // Registers a sweep and adds it to the local map. The cloud is read during the call only. Without a prior the motion
  // is predicted by constant velocity. The reference is valid until the next call on this object.
  // The first pose is the identity, or the first prior if that is absolute.
  const Estimate& process(const Cloud& cloud, const Prior* prior = nullptr);

  // When this cloud was measured and the instant that its pose will refer to: ask a predicting filter for these times.
  SweepStamps stamps(const Cloud& cloud) const;

  // The last estimate.
  const Estimate& estimate() const;

  // As after construction; keeps the memory.
  void reset();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::lidar_odometry
