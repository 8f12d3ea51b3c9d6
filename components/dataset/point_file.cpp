#include "components/dataset/point_file.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace adit::dataset {

std::vector<std::string> standard_fields(std::size_t columns) {
  const std::vector<std::string> all = {"x", "y", "z", "intensity", "time", "ring"};
  return {all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(columns, all.size()))};
}

Result<PointFile> read_bin(const std::string& path, std::size_t points) {
  std::error_code bad;
  const std::uintmax_t bytes = std::filesystem::file_size(path, bad);
  if (bad) return Error{ErrorCode::not_found, path + ": cannot read: " + bad.message()};
  const std::uintmax_t row = points > 0 ? bytes / points : 4 * sizeof(float);
  const std::size_t columns = row / sizeof(float);
  if (bytes == 0) return Error{ErrorCode::malformed, path + ": the file is empty"};
  if (row % sizeof(float) != 0 || bytes % row != 0 || columns < 3 || columns > 6 ||
      (points > 0 && row * points != bytes)) {
    return Error{ErrorCode::malformed,
                 path + ": " + std::to_string(bytes) + " bytes are not " +
                     (points > 0 ? std::to_string(points) + " points of 3 to 6 float32 columns" : "rows of 4 float32")};
  }
  PointFile cloud;
  cloud.fields = standard_fields(columns);
  cloud.points = bytes / row;
  cloud.values.resize(cloud.points * columns);
  std::ifstream file(path, std::ios::binary);
  if (!file.read(reinterpret_cast<char*>(cloud.values.data()), static_cast<std::streamsize>(bytes))) {
    return Error{ErrorCode::io, path + ": cannot read: " + std::strerror(errno)};
  }
  return cloud;
}

Result<void> write_bin(const std::string& path, const PointFile& cloud) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(cloud.values.data()),
             static_cast<std::streamsize>(cloud.values.size() * sizeof(float)));
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write: " + std::strerror(errno)};
  return {};
}

}  // namespace adit::dataset
