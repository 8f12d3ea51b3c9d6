// Surfels: small pieces of surface, each a point with a normal, made from blocks of neighbouring pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "components/lidar_odometry/cloud.hpp"
#include "components/lidar_odometry/config.hpp"
#include "components/lidar_odometry/estimate.hpp"
#include "components/lidar_odometry/voxel_table.hpp"
#include "components/lidar_odometry/worker_pool.hpp"

namespace adit::lidar_odometry {

struct Surfel {
  Eigen::Vector3f point;      // m, sensor frame at its own time
  Eigen::Vector3f normal;     // unit, towards the sensor
  float time = 0.0f;          // s after the stamp
  std::uint16_t cluster = 0;  // its part of the image, of image_clusters
};

// Parts of the image, 64 x 16: what lies in different ones counts as independent evidence.
inline constexpr std::size_t cluster_columns = 64;
inline constexpr std::size_t cluster_rows = 16;
inline constexpr std::size_t image_clusters = cluster_columns * cluster_rows;

class SurfelExtractor {
 public:
  explicit SurfelExtractor(const Config& config) : config_(config) {}

  // The surfels of an organised cloud in image order; counts what it drops.
  void extract(const Cloud& image, WorkerPool& pool, std::vector<Surfel>& surfels, ScanCounters& counters);

 private:
  // Moments of a block of pixels; count 0: rejected.
  struct Block {
    Eigen::Vector3f mean;
    float scatter[6];  // sum of (p - mean)(p - mean)^T: xx xy xz yy yz zz
    float range;
    float count;
  };
  void make_blocks(const Cloud& image, std::size_t block_row);
  bool make_surfel(const Cloud& image, std::size_t row, std::size_t column, Surfel& surfel) const;

  Config config_;
  std::size_t block_columns_ = 0, block_rows_ = 0;  // pixels of a block
  std::size_t columns_ = 0, rows_ = 0;              // blocks of the image
  struct RowCounters {
    std::uint32_t invalid, out_of_range;
  };
  std::vector<Block> blocks_;
  std::vector<RowCounters> row_counters_;
  std::vector<std::uint32_t> selected_;
  std::vector<std::uint8_t> kept_;
  std::vector<Surfel> candidates_;
  VoxelFilter filter_;
};

}  // namespace adit::lidar_odometry
