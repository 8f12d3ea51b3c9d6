#include "components/config/quantity.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>

namespace adit {
namespace {

// A quotient, so that what a decimal factor cannot express exactly is rounded once.
struct Unit {
  std::string_view name;
  double times = 1.0, by = 1.0;
};

constexpr Unit units[] = {{"m"},
                          {"cm", 1e-2},
                          {"km", 1e3},
                          {"s"},
                          {"ms", 1e-3},
                          {"us", 1e-6},
                          {"min", 60.0},
                          {"m/s"},
                          {"km/h", 1.0, 3.6},
                          {"rad"},
                          {"deg", std::numbers::pi, 180.0},
                          {"Hz"},
                          {"K"},
                          {"mK", 1e-3},
                          {"%", 1e-2}};

}  // namespace

std::optional<double> parse_quantity(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (bad != std::errc{} || !std::isfinite(value)) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  if (text.empty()) return value;
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  for (const Unit& unit : units) {
    if (unit.name == text) return value * unit.times / unit.by;
  }
  return std::nullopt;
}

std::string quantity_units() {
  std::string list;
  for (const Unit& unit : units) list += (list.empty() ? "" : ", ") + std::string(unit.name);
  return list;
}

}  // namespace adit
