#include "components/state_estimator/noise_adaptation.hpp"

#include <algorithm>
#include <cmath>

namespace adit::state_estimator {

double chi_square_bound(double dof, bool upper) {
  constexpr double normal_99 = 2.3263;  // quantile of the standard normal distribution
  const double spread = 2.0 / (9.0 * dof);
  const double root = 1.0 - spread + (upper ? normal_99 : -normal_99) * std::sqrt(spread);  // Wilson and Hilferty
  return root * root * root;
}

void NoiseAdaptation::add(double innovation_nis, int rows, double share, const NoiseAdaptationConfig& config) {
  nis += std::min(innovation_nis, config.largest_nis_per_dof * rows);
  dof += rows;
  share_dof += share * rows;
  if (dof < config.window) return;
  const double mean = nis / dof, own = share_dof / dof;
  const bool honest = mean >= chi_square_bound(dof, false) && mean <= chi_square_bound(dof, true);
  nis = dof = share_dof = 0.0;
  if (honest || own < config.least_share) return;
  // The innovation's covariance is HPH' + R: only the part of R moves. mean = (1 - own) + own * true / used.
  const double wanted = (mean - (1.0 - own)) / own;
  factor *= std::clamp(wanted, 1.0 / config.largest_step, config.largest_step);
  factor = std::clamp(factor, 1.0, config.most);
}

}  // namespace adit::state_estimator
