// SHA-256 (FIPS 180-4), for the ROS type hash.
#pragma once

#include <string>
#include <string_view>

namespace adit::generator {

// 64 lower-case hex digits.
std::string sha256_hex(std::string_view message);

}  // namespace adit::generator
