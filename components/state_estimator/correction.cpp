#include "components/state_estimator/correction.hpp"

#include <type_traits>

#include <Eigen/Cholesky>

#include "components/geometry/se3.hpp"

namespace adit::state_estimator {
namespace {

template <int Rows>
struct Terms {
  Eigen::Matrix<double, Rows, 1> nu;
  Eigen::Matrix<double, Rows, Rows> r;
  Eigen::LLT<Eigen::Matrix<double, Rows, Rows>> cholesky;  // of S

  explicit Terms(const Innovation& innovation)
      : nu(innovation.value.head<Rows>()), r(innovation.covariance.topLeftCorner<Rows, Rows>()) {
    cholesky.compute(innovation.predicted.topLeftCorner<Rows, Rows>() + r);
  }
};

template <int Rows>
double distance(const Innovation& innovation) {
  const Terms<Rows> t(innovation);
  return t.cholesky.info() == Eigen::Success ? t.nu.dot(t.cholesky.solve(t.nu)) : -1.0;
}

template <int Rows>
double share(const Innovation& innovation) {
  const Terms<Rows> t(innovation);
  return t.cholesky.info() == Eigen::Success ? t.cholesky.solve(t.r).trace() / Rows : 0.0;
}

// Errors of position and heading belong together: a heading error turns the way to here about the origin. A correction
// that moves the position along its error therefore moves what the heading's error does to it: e_p - J p e_psi stays
// (right-invariant error on SE(2): Barrau and Bonnabel, "The invariant extended Kalman filter as a stable observer",
// 2017). Left out, relative measurements seem to tell the heading, which they cannot.
void move_errors(StateMatrix& p, int position, int heading, const Eigen::Vector2d& moved) {
  const Eigen::Vector2d turned(-moved.y(), moved.x());  // J * moved
  p.middleRows<2>(position).noalias() += turned * p.row(heading).eval();
  p.middleCols<2>(position).noalias() += p.col(heading).eval() * turned.transpose();
}

template <int Rows>
bool correct_rows(FilterState& state, const Innovation& innovation) {
  const Terms<Rows> t(innovation);
  if (t.cholesky.info() != Eigen::Success) return false;
  const auto h = innovation.jacobian.topRows<Rows>();
  const Eigen::Matrix<double, kStates, Rows> pht = innovation.cross.leftCols<Rows>();
  const Eigen::Matrix<double, kStates, Rows> k = t.cholesky.solve(pht.transpose()).transpose();
  const StateVector x = state.x + k * t.nu;
  // (I - K H) P, then times (I - K H)' plus K R K', each as a low-rank change.
  StateMatrix p = state.p;
  p.noalias() -= k.lazyProduct(pht.transpose());
  const Eigen::Matrix<double, kStates, Rows> rest = k * t.r - p.lazyProduct(h.transpose());
  p.noalias() += rest.lazyProduct(k.transpose());
  move_errors(p, kX, kYaw, x.segment<2>(kX) - state.x.segment<2>(kX));
  for (int slot = 0; slot < kCloneSlots; ++slot) {
    const int pose = clone_index(slot);
    move_errors(p, pose, pose + 2, x.segment<2>(pose) - state.x.segment<2>(pose));
  }
  if (!x.allFinite() || !p.allFinite()) return false;
  state.x = x;
  state.p = 0.5 * (p + p.transpose());
  state.x(kYaw) = wrap_angle(state.x(kYaw));
  for (int slot = 0; slot < kCloneSlots; ++slot) {
    double& angle = state.x(clone_index(slot) + 2);
    angle = wrap_angle(angle);
  }
  return true;
}

// `work` for the number of rows as a constant; `otherwise` for a number that no measurement has.
template <class Value, class Work>
Value with_rows(const Innovation& innovation, Value otherwise, Work work) {
  switch (innovation.rows) {
    case 1:
      return work(std::integral_constant<int, 1>());
    case 2:
      return work(std::integral_constant<int, 2>());
    case 3:
      return work(std::integral_constant<int, 3>());
    default:
      return otherwise;
  }
}

}  // namespace

double chi_square(int dof, Quantile quantile) {
  constexpr double table[3][4] = {
      {3.8415, 6.6349, 10.8276, 15.1367}, {5.9915, 9.2103, 13.8155, 18.4207}, {7.8147, 11.3449, 16.2662, 21.1075}};
  return table[dof < 1 ? 0 : dof > 3 ? 2 : dof - 1][static_cast<int>(quantile)];
}

Innovation project(const FilterState& state, const Linearization& linearization, const Measurement& measurement) {
  Innovation innovation;
  innovation.rows = measurement.rows;
  innovation.value = measurement.projection * linearization.innovation;
  innovation.jacobian = measurement.projection * linearization.jacobian;
  innovation.covariance = measurement.covariance;
  see_from(state, innovation);
  return innovation;
}

void see_from(const FilterState& state, Innovation& innovation) {
  innovation.cross.noalias() = state.p.lazyProduct(innovation.jacobian.transpose());
  innovation.predicted.noalias() = innovation.jacobian.lazyProduct(innovation.cross);
}

double squared_distance(const Innovation& innovation) {
  return with_rows(innovation, -1.0, [&](auto rows) { return distance<rows>(innovation); });
}

double noise_share(const Innovation& innovation) {
  return with_rows(innovation, 0.0, [&](auto rows) { return share<rows>(innovation); });
}

bool correct(FilterState& state, const Innovation& innovation) {
  return with_rows(innovation, false, [&](auto rows) { return correct_rows<rows>(state, innovation); });
}

}  // namespace adit::state_estimator
