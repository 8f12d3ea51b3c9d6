#include <algorithm>
#include <array>
#include <numbers>

#include "components/tunnel_simulator/lidar.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

BeamTable uniform(int rings, double top, double bottom, int columns) {
  BeamTable table;
  table.columns = columns;
  for (int i = 0; i < rings; ++i) {
    table.elevation.push_back(kDegree * (top + (bottom - top) * i / (rings - 1)));
  }
  table.azimuth_offset.assign(static_cast<std::size_t>(rings), 0.0);
  table.time_offset.assign(static_cast<std::size_t>(rings), 0.0);
  return table;
}

void stagger(BeamTable& table) {  // four columns of lasers
  static constexpr std::array<double, 4> kOffsets{2.08, 0.69, -0.69, -2.06};
  for (std::size_t i = 0; i < table.elevation.size(); ++i) table.azimuth_offset[i] = kDegree * kOffsets[i % 4];
  table.origin_radius = 0.013762;
}

}  // namespace

Result<BeamTable> beam_table(const std::string& name, int columns) {
  const int width = columns > 0 ? columns : 1024;
  if (name == "os2_paper") return uniform(128, 22.5, -22.5, width);
  if (name == "os1") {
    BeamTable table = uniform(128, 22.5, -22.5, width);
    stagger(table);
    return table;
  }
  if (name == "os0") {
    BeamTable table = uniform(128, 45.0, -45.0, width);
    stagger(table);
    return table;
  }
  if (name == "os2_real") {  // pitches of one unit run from 10.76 to -11.09 degrees, 0.14 to 0.20 apart
    BeamTable table = uniform(128, 10.76, -11.09, width);
    for (std::size_t i = 1; i + 1 < table.elevation.size(); ++i) {
      table.elevation[i] += kDegree * 0.012 * (i % 4 == 1 ? 1.0 : i % 4 == 2 ? -1.0 : 0.0);
    }
    stagger(table);
    return table;
  }
  if (name == "vlp16") {  // one laser after the other, 2.304 us apart
    BeamTable table = uniform(16, 15.0, -15.0, columns > 0 ? columns : 1808);
    for (std::size_t i = 0; i < 16; ++i) table.time_offset[i] = 2.304e-6 * static_cast<double>(i);
    return table;
  }
  return Error{ErrorCode::not_found, "no beam table '" + name + "' (os2_paper, os2_real, os1, os0, vlp16)"};
}

}  // namespace adit::tunnel_simulator
