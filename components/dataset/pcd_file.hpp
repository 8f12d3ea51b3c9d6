// PCD files, every encoding PCL reads. Links pcl_io (and with it VTK): host tools only.
#pragma once

#include "components/dataset/point_file.hpp"

namespace adit::dataset {

// Reads x, y, z and, where present, intensity, a per-point time (t, time, timestamp, offset_time; integers are
// nanoseconds, as drivers write them) and ring (ring, line, channel). Other fields are left out.
Result<PointFile> read_pcd(const std::string& path);

}  // namespace adit::dataset
