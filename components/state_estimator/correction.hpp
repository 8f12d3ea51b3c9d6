// The Kalman correction and its gate.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "components/state_estimator/measurement.hpp"
#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

// Chi-square quantile for 1 to 3 degrees of freedom, to be compared with the squared Mahalanobis distance.
enum class Quantile { p95, p99, p99_9, p99_99 };
double chi_square(int dof, Quantile quantile);

// A linearized measurement in its informative directions, seen from one state.
struct Innovation {
  int rows = 0;
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, kMaxRows, kStates> jacobian = Eigen::Matrix<double, kMaxRows, kStates>::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the measurement: R
  Eigen::Matrix<double, kStates, kMaxRows> cross = Eigen::Matrix<double, kStates, kMaxRows>::Zero();  // P H'
  Eigen::Matrix3d predicted = Eigen::Matrix3d::Zero();                                                // H P H'
};
Innovation project(const FilterState& state, const Linearization& linearization, const Measurement& measurement);
// Fills `cross` and `predicted`: done by project(), and due again when the state's covariance changes afterwards.
void see_from(const FilterState& state, Innovation& innovation);

// Squared Mahalanobis distance nu' S^-1 nu (NIS), S = H P H' + R. Negative when S is not positive definite.
double squared_distance(const Innovation& innovation);

// Share of the measurement's noise R in the innovation's covariance S: trace(S^-1 R) / rows, 0 to 1; 0 when S is not
// positive definite.
double noise_share(const Innovation& innovation);

// x += K nu, P = (I - K H) P (I - K H)' + K R K' (Joseph), angles wrapped, P symmetric. Returns false and changes
// nothing when the innovation's covariance is not positive definite or the result would not be finite. The innovation
// is that of this very state.
bool correct(FilterState& state, const Innovation& innovation);

}  // namespace adit::state_estimator
