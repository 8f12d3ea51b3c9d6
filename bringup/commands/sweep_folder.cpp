#include "bringup/commands/sweep_folder.hpp"

#include <algorithm>

#include "components/dataset/pcd_file.hpp"

namespace adit {

Result<dataset::Dataset> open_clouds(const std::string& folder, double file_rate) {
  Result<dataset::Dataset> dataset = dataset::open_dataset(folder, file_rate);
  if (dataset && dataset->kind == dataset::Dataset::Kind::png16) {
    return Error{ErrorCode::invalid_argument, folder + " holds images, not clouds"};
  }
  return dataset;
}

Result<mapping::OwnedSweep> read_sweep(const dataset::Dataset& dataset, std::size_t index) {
  const dataset::Entry& entry = dataset.entries[index];
  const Result<dataset::PointFile> file = dataset.kind == dataset::Dataset::Kind::pcd
                                              ? dataset::read_pcd(entry.path)
                                              : dataset::read_bin(entry.path, entry.points);
  if (!file) return file.error();
  const auto column = [&](const char* name) -> std::ptrdiff_t {
    const auto found = std::find(file->fields.begin(), file->fields.end(), name);
    return found == file->fields.end() ? -1 : found - file->fields.begin();
  };
  const std::ptrdiff_t intensity = column("intensity"), time = column("time");
  mapping::OwnedSweep sweep;
  sweep.stamp_ns = entry.stamp_ns;
  sweep.points.reserve(file->points);
  for (std::size_t i = 0; i < file->points; ++i) {
    const float* row = &file->values[i * file->fields.size()];
    sweep.points.push_back({{row[0], row[1], row[2]}, intensity < 0 ? 0.0F : row[intensity]});
    if (time >= 0) sweep.seconds.push_back(row[time]);
  }
  return sweep;
}

}  // namespace adit
