// A sensor's covariance as its innovations show it: the reported one times a factor, found by covariance matching. A
// window of normalized innovations squared has a chi-square distribution when the covariance is right; outside its band
// the factor moves to where the mean would be one (Mehra, "Approaches to adaptive filtering", IEEE TAC 1972, for one
// scale of R instead of all its entries).
#pragma once

namespace adit::state_estimator {

struct NoiseAdaptationConfig {
  bool enabled = true;
  double window = 45.0;  // degrees of freedom in a window: 15 relative poses
  // Of the factor; never below 1: what does not show in the innovations, like a scale error, is in the report at best.
  double most = 400.0;
  double largest_step = 4.0;          // of the factor, from window to window
  double least_share = 0.15;          // of the sensor's noise in the innovation: below, it cannot be told
  double largest_nis_per_dof = 30.0;  // one innovation counts at most this: an outlier is the gate's business
};

// Part of the filter's state. Trivially copyable.
struct NoiseAdaptation {
  double factor = 1.0;     // on the sensor's covariance
  double nis = 0.0;        // of the window so far
  double share_dof = 0.0;  // sum of share times degrees of freedom
  double dof = 0.0;

  // `nis` of an innovation with `rows` degrees of freedom, computed with the factor; `share` of the measurement's noise
  // in its covariance: trace(S^-1 R) / rows.
  void add(double innovation_nis, int rows, double share, const NoiseAdaptationConfig& config);
};

// Mean of chi-square / dof that is exceeded with 1 % (`upper`), or not reached with 1 % probability. For dof >= 10.
double chi_square_bound(double dof, bool upper);

}  // namespace adit::state_estimator
