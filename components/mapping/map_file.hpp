// Maps as files that other programs read.
#pragma once

#include <string>

#include "components/mapping/cloud.hpp"
#include "idl/result.hpp"

namespace adit::mapping {

// x, y, z, intensity as float32, binary, by the path's ending: .ply (little endian) or .pcd (version 0.7). Replaces the
// file. Errors: another ending, a folder that does not exist, what the system says.
Result<void> write_map(const std::string& path, std::span<const Point> points);

}  // namespace adit::mapping
