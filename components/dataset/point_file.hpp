// Point clouds as interleaved float32 columns, the layout of KITTI's .bin files and of this project's recordings.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "idl/result.hpp"

namespace adit::dataset {

// `points` rows of `fields.size()` floats. Fields are, in this order as far as present: x, y, z [m] in the sensor
// frame, intensity, time [s] after the sweep's start, ring.
struct PointFile {
  std::vector<std::string> fields;
  std::size_t points = 0;
  std::vector<float> values;
};

// The names of the first `columns` fields; `columns` is 3 to 6.
std::vector<std::string> standard_fields(std::size_t columns);

// Reads a .bin file. `points` from the index tells the number of columns; 0: unknown, 4 columns as KITTI has them.
// Errors: unreadable, empty, a size that does not fit.
Result<PointFile> read_bin(const std::string& path, std::size_t points);

// Writes the values as they are.
Result<void> write_bin(const std::string& path, const PointFile& cloud);

}  // namespace adit::dataset
