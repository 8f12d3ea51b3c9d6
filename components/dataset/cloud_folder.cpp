#include "components/dataset/cloud_folder.hpp"

#include "components/dataset/pcd_file.hpp"

namespace adit::dataset {

Result<Dataset> open_clouds(const std::string& folder, double rate_hz) {
  Result<Dataset> dataset = open_dataset(folder, rate_hz);
  if (dataset && dataset->kind == Dataset::Kind::png16) {
    return Error{ErrorCode::invalid_argument, folder + " holds images, not clouds"};
  }
  return dataset;
}

Result<PointFile> read_cloud(const Dataset& clouds, std::size_t index) {
  const Entry& entry = clouds.entries[index];
  return clouds.kind == Dataset::Kind::pcd ? read_pcd(entry.path) : read_bin(entry.path, entry.points);
}

}  // namespace adit::dataset
