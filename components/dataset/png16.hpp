// 16-bit grey images as PNG, the values unchanged in both directions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/result.hpp"

namespace adit::dataset {

struct Image16 {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint16_t> pixels;  // row by row
};

// Refuses everything but 16-bit grey: an 8-bit image is what automatic gain control left of a thermal frame.
Result<Image16> read_png16(const std::string& path);
Result<void> write_png16(const std::string& path, const Image16& image);

}  // namespace adit::dataset
