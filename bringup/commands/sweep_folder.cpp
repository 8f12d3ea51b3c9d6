#include "bringup/commands/sweep_folder.hpp"

#include <algorithm>

#include "components/dataset/cloud_folder.hpp"

namespace adit {

Result<mapping::OwnedSweep> read_sweep(const dataset::Dataset& dataset, std::size_t index) {
  const Result<dataset::PointFile> file = dataset::read_cloud(dataset, index);
  if (!file) return file.error();
  const auto column = [&](const char* name) -> std::ptrdiff_t {
    const auto found = std::find(file->fields.begin(), file->fields.end(), name);
    return found == file->fields.end() ? -1 : found - file->fields.begin();
  };
  const std::ptrdiff_t intensity = column("intensity"), time = column("time");
  mapping::OwnedSweep sweep;
  sweep.stamp_ns = dataset.entries[index].stamp_ns;
  sweep.points.reserve(file->points);
  for (std::size_t i = 0; i < file->points; ++i) {
    const float* row = &file->values[i * file->fields.size()];
    sweep.points.push_back({{row[0], row[1], row[2]}, intensity < 0 ? 0.0F : row[intensity]});
    if (time >= 0) sweep.seconds.push_back(row[time]);
  }
  return sweep;
}

}  // namespace adit
