// The index of a recorded folder.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/result.hpp"

namespace adit::dataset {

struct Entry {
  std::string path;
  std::int64_t stamp_ns = 0;
  std::size_t points = 0;  // clouds: as the index says; 0 = unknown
};

struct Dataset {
  enum class Kind { bin, pcd, png16 };
  Kind kind = Kind::bin;
  std::vector<Entry> entries;  // stamps never decrease; not empty
};

// Finds one of the layouts of README.md in `folder`. `rate_hz` stamps entries without stamps (starting at 0). Errors
// say what was looked for, and name file and line: an index that names a missing file, a stamp that is no number or
// runs backwards, a folder without data.
Result<Dataset> open_dataset(const std::string& folder, double rate_hz);

// The images of a folder that may hold clouds as well: images/*.png or *.png, stamped by times.txt or the rate.
Result<Dataset> open_images(const std::string& folder, double rate_hz);

}  // namespace adit::dataset
