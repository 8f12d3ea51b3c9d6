#include "components/tunnel_simulator/normal_table.hpp"

#include <cmath>
#include <numbers>

namespace adit::tunnel_simulator {

NormalTable::NormalTable() : values_(65536) {
  // Newton's method on the distribution function, from the level before; symmetric.
  double x = 0.0;
  double square = 0.0;
  std::vector<double> upper(32768);
  for (std::size_t i = 0; i < upper.size(); ++i) {
    const double wanted = (static_cast<double>(i) + 0.5) / 65536.0;  // probability above the median
    for (int k = 0; k < 4; ++k) {
      const double error = 0.5 * std::erf(x / std::numbers::sqrt2) - wanted;
      x -= error * std::sqrt(2.0 * std::numbers::pi) * std::exp(0.5 * x * x);
    }
    upper[i] = x;
    square += x * x;
  }
  const double scale = 1.0 / std::sqrt(square / static_cast<double>(upper.size()));
  for (std::size_t i = 0; i < upper.size(); ++i) {
    values_[32768 + i] = static_cast<float>(scale * upper[i]);
    values_[32767 - i] = -values_[32768 + i];
  }
}

const NormalTable& NormalTable::instance() {
  static const NormalTable table;
  return table;
}

}  // namespace adit::tunnel_simulator
