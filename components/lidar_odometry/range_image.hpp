// Any cloud as a range image: rows are rings, columns are azimuth.
#pragma once

#include <vector>

#include "components/lidar_odometry/cloud.hpp"

namespace adit::lidar_odometry {

// Sorts a cloud that is not organised into rows and columns. Rows come from Cloud::rings; without them from the
// elevations, which of a spinning LiDAR are few and distinct; without that, from equal steps of elevation.
class RangeImage {
 public:
  // An organised cloud is returned as it is; of any other a copy, valid until the next call. At most one point a pixel,
  // the first. The columns start at the azimuth of the earliest point, so that neighbours are close in time, too.
  Cloud organise(const Cloud& cloud);

 private:
  std::size_t assign_rows(const Cloud& cloud);
  std::size_t rows_from_elevation(const Cloud& cloud);

  std::vector<std::uint16_t> rows_;  // by point; no_row: not used
  std::vector<std::uint32_t> counts_;
  std::vector<std::uint16_t> row_of_bin_;
  std::vector<Point3f> points_;
  std::vector<float> seconds_;
};

}  // namespace adit::lidar_odometry
