// Numbers with their unit, as people write them in configuration files.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace adit {

// "36 km/h" to 10: SI units (m, s, m/s, rad, K, Hz), "%" a share of 1. A number without unit is taken as it is. Empty
// for anything else: an unknown unit, words, infinity.
std::optional<double> parse_quantity(std::string_view text);

// The units that are known, for messages.
std::string quantity_units();

}  // namespace adit
