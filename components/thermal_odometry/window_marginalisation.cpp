#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "components/thermal_odometry/window.hpp"

namespace adit::thermal_odometry {
namespace {

using Block = Eigen::Matrix<double, state_size, state_size>;

constexpr double min_points_share = 0.05;  // of the points a keyframe hosted (DSO)

}  // namespace

void eliminate_block(Window::Matrix& H, Window::Vector& g, int at) {
  Block Hss = H.block<state_size, state_size>(at, at);
  Hss = 0.5 * (Hss + Hss.transpose()).eval();
  // Scaled to a unit diagonal, then inverted on the well-determined subspace only.
  Eigen::Matrix<double, state_size, 1> scale = (Hss.diagonal().cwiseAbs().array() + 1e-9).sqrt().inverse();
  const Eigen::SelfAdjointEigenSolver<Block> eigen(scale.asDiagonal() * Hss * scale.asDiagonal());
  Eigen::Matrix<double, state_size, 1> values = eigen.eigenvalues();
  const double floor = 1e-10 * std::max(1e-9, values.maxCoeff());
  for (double& value : values) value = value > floor ? 1.0 / value : 0.0;
  const Block inverse = scale.asDiagonal() * eigen.eigenvectors() * values.asDiagonal() *
                        eigen.eigenvectors().transpose() * scale.asDiagonal();
  Eigen::Matrix<double, Window::dimension, state_size> Hrs = H.middleCols<state_size>(at);
  Hrs.middleRows<state_size>(at).setZero();
  const Eigen::Matrix<double, Window::dimension, state_size> gain = Hrs * inverse;
  g -= gain * g.segment<state_size>(at).eval();
  H -= gain.lazyProduct(Hrs.transpose());
  H.middleCols<state_size>(at).setZero();
  H.middleRows<state_size>(at).setZero();
  g.segment<state_size>(at).setZero();
  H = 0.5 * (H + H.transpose()).eval();
}

void Window::retire_points() {
  int second = -1;
  for (int s = 0; s < max_keyframes; ++s) {
    if (keyframe(s).used && s != newest_ && (second < 0 || keyframe(s).id > keyframe(second).id)) second = s;
  }
  systems_.resize(points_.size());
  bool any = false;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const WindowPoint& point = points_[i];
    const bool young = point.patch.host == newest_ || point.patch.host == second;
    const auto lost = [&](int s) {
      return s < 0 || point.sight[static_cast<std::size_t>(s)] == Sight::outside ||
             point.sight[static_cast<std::size_t>(s)] == Sight::outlier;
    };
    systems_[i].marked = !young && lost(newest_) && lost(second);
    any = any || systems_[i].marked;
  }
  if (any) eliminate(-1);
}

void Window::marginalise(int slot) {
  systems_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) systems_[i].marked = points_[i].patch.host == slot;
  eliminate(slot);
}

// Marked points become part of the prior if they were seen well; then the slot, if any, is eliminated.
void Window::eliminate(int slot) {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!systems_[i].marked) continue;
    const WindowPoint& point = points_[i];
    const float d = point.patch.inverse_depth;
    const bool worth = point.good >= 2 && point.hessian * d * d > config_.min_hessian;
    if (!worth) {
      systems_[i].marked = false;
      points_[i].good = -1;  // dropped below without entering the prior
    }
  }
  linearise(true, 0.0);
  const Vector x = delta();
  prior_H_ += normal_.H;
  prior_g_ += normal_.g - normal_.H * x;
  for (int s = 0; s < max_keyframes; ++s) {
    if (keyframe(s).used && normal_.H(s * state_size, s * state_size) > 0.0) keyframe(s).in_prior = true;
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (points_[i].good == -1 || (slot >= 0 && points_[i].patch.host == slot)) systems_[i].marked = true;
  }
  remove_marked();
  if (slot < 0) return;
  Keyframe& k = keyframe(slot);
  const int at = slot * state_size;
  const double a_information = 1.0 / (config_.gain_sigma * config_.gain_sigma);
  const double b_information = 1.0 / (config_.offset_sigma * config_.offset_sigma);
  prior_H_(at + 6, at + 6) += a_information;
  prior_g_[at + 6] += a_information * k.first.a;
  prior_H_(at + 7, at + 7) += b_information;
  prior_g_[at + 7] += b_information * k.first.b;
  eliminate_block(prior_H_, prior_g_, at);
  k.used = false;
  k.in_prior = false;
  k.delta.setZero();
}

int Window::least_useful() const {
  int second = -1;
  for (int s = 0; s < max_keyframes; ++s) {
    if (keyframe(s).used && s != newest_ && (second < 0 || keyframe(s).id > keyframe(second).id)) second = s;
  }
  const auto distance = [this](int i, int j) {
    return (keyframe(i).state.T_cw.inverse().translation() - keyframe(j).state.T_cw.inverse().translation()).norm();
  };
  std::array<int, max_keyframes> points{};
  for (const WindowPoint& point : points_) ++points[static_cast<std::size_t>(point.patch.host)];
  int worst = -1;
  double worst_score = -1.0;
  for (int i = 0; i < max_keyframes; ++i) {
    if (!keyframe(i).used || i == newest_ || i == second) continue;
    if (points[static_cast<std::size_t>(i)] <= min_points_share * keyframe(i).hosted) return i;
    double crowding = 0.0;
    for (int j = 0; j < max_keyframes; ++j) {
      if (keyframe(j).used && j != i && j != newest_ && j != second) crowding += 1.0 / (distance(i, j) + 1e-5);
    }
    const double score = std::sqrt(distance(i, newest_)) * (crowding + 1e-9);
    if (score > worst_score) {
      worst_score = score;
      worst = i;
    }
  }
  return worst;
}

void Window::rescale(double factor) {
  const Eigen::Vector3d centre = keyframe(newest_).state.T_cw.inverse().translation();
  const auto scaled = [&](const Pose& T_cw) {
    Pose T = T_cw;
    const Eigen::Vector3d position = T_cw.inverse().translation();
    T.translation() = -(T.linear() * (centre + factor * (position - centre)));
    return T;
  };
  Vector inverse = Vector::Ones();
  for (int s = 0; s < max_keyframes; ++s) {
    inverse.segment<3>(s * state_size).setConstant(1.0 / factor);
    Keyframe& k = keyframe(s);
    if (!k.used) continue;
    k.first.T_cw = scaled(k.first.T_cw);
    k.state.T_cw = scaled(k.state.T_cw);
    k.delta.head<6>() = se3_log(k.state.T_cw * k.first.T_cw.inverse());
    k.state.rate.head<3>() *= factor;
    k.first.rate.head<3>() *= factor;
  }
  prior_H_ = inverse.asDiagonal() * prior_H_ * inverse.asDiagonal();
  prior_g_ = inverse.asDiagonal() * prior_g_;
  for (WindowPoint& point : points_) {
    const auto f = static_cast<float>(1.0 / factor);
    for (float* value : {&point.patch.inverse_depth, &point.patch.slope_u, &point.patch.slope_v, &point.patch.sigma,
                         &point.prior_depth}) {
      *value *= f;
    }
    point.by_boresight *= f;
    point.prior_information /= f * f;
  }
}

}  // namespace adit::thermal_odometry
