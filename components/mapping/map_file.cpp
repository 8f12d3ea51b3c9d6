#include "components/mapping/map_file.hpp"

#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace adit::mapping {
namespace {

static_assert(std::endian::native == std::endian::little, "both formats are written as the memory is");
static_assert(sizeof(Point) == 4 * sizeof(float));

std::string ply_header(std::size_t points) {
  return "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points) +
         "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\nend_header\n";
}

std::string pcd_header(std::size_t points) {
  const std::string n = std::to_string(points);
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\n"
         "COUNT 1 1 1 1\nWIDTH " +
         n + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + n + "\nDATA binary\n";
}

}  // namespace

Result<void> write_map(const std::string& path, std::span<const Point> points) {
  const bool ply = path.ends_with(".ply");
  if (!ply && !path.ends_with(".pcd")) {
    return Error{ErrorCode::invalid_argument, path + ": a map's file ends in .pcd or .ply"};
  }
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << (ply ? ply_header(points.size()) : pcd_header(points.size()));
  file.write(reinterpret_cast<const char*>(points.data()), static_cast<std::streamsize>(points.size_bytes()));
  file.close();
  if (!file) return Error{ErrorCode::io, path + ": cannot write: " + std::strerror(errno)};
  return {};
}

}  // namespace adit::mapping
