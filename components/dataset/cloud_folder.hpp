// Folders of clouds, whichever format their files have. In the library of pcd_file.hpp.
#pragma once

#include "components/dataset/dataset.hpp"
#include "components/dataset/point_file.hpp"

namespace adit::dataset {

// As open_dataset; images are refused.
Result<Dataset> open_clouds(const std::string& folder, double rate_hz);

// Entry `index` of a dataset of clouds.
Result<PointFile> read_cloud(const Dataset& clouds, std::size_t index);

}  // namespace adit::dataset
