#include "components/dataset/pcd_file.hpp"

namespace adit::dataset {

Result<PointFile> read_pcd(const std::string& path) {
  return Error{ErrorCode::unavailable,
               path + ": this build reads no PCD files (they need PCL and VTK): convert it to .bin on a host"};
}

}  // namespace adit::dataset
