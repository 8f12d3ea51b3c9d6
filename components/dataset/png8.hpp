// Pictures for people, 8 bits a channel, as PNG. (Sensor data: png16.hpp.)
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "idl/result.hpp"

namespace adit::dataset {

// A view; row after row.
struct Picture8 {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t channels = 3;  // 1: grey, 3: red, green, blue
  std::uint32_t step = 0;      // bytes from row to row; 0: width * channels
  std::span<const std::uint8_t> data;
};

Result<void> write_png8(const std::string& path, const Picture8& picture);

}  // namespace adit::dataset
