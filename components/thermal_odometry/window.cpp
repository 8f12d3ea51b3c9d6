#include "components/thermal_odometry/window.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace adit::thermal_odometry {
namespace {

constexpr double origin_information = 1e10;  // holds the brightness of the first keyframe

}  // namespace

Window::Window(const Pinhole& camera, std::size_t capacity, const Config& config) : camera_(camera), config_(config) {
  points_.reserve(capacity);
  systems_.reserve(capacity);
  couplings_.resize(capacity);
  boresight_covariance_ = config.boresight_sigma * config.boresight_sigma * Eigen::Matrix3d::Identity();
  begin_prior();
}

void Window::clear() {
  for (Keyframe& keyframe : keyframes_) {
    keyframe.used = false;
    keyframe.in_prior = false;
  }
  newest_ = -1;
  points_.clear();
  begin_prior();
  sigma_ = 1.5F;
}

// Nothing is known but the boresight; as the covariance is said of it, its information counts as often as that of
// pixels.
void Window::begin_prior() {
  prior_H_.setZero();
  prior_g_.setZero();
  const Eigen::Matrix3d information =
      config_.correlation * (boresight_covariance_ + 1e-14 * Eigen::Matrix3d::Identity()).inverse();
  prior_H_.bottomRightCorner<boresight_size, boresight_size>() = information;
  prior_g_.tail<boresight_size>() = -information * boresight_;
}

int Window::free_slot() const {
  for (int i = 0; i < max_keyframes; ++i) {
    if (!keyframe(i).used) return i;
  }
  return -1;
}

int Window::oldest() const {
  int slot = -1;
  for (int s = 0; s < max_keyframes; ++s) {
    if (keyframe(s).used && (slot < 0 || keyframe(s).id < keyframe(slot).id)) slot = s;
  }
  return slot;
}

int Window::count() const {
  return static_cast<int>(
      std::count_if(keyframes_.begin(), keyframes_.end(), [](const Keyframe& k) { return k.used; }));
}

int Window::add_keyframe(std::int64_t stamp_ns, const CameraState& state, Pyramid& image) {
  const int slot = free_slot();
  if (slot < 0) return -1;
  const bool origin = count() == 0;
  Keyframe& k = keyframe(slot);
  k.used = true;
  k.in_prior = origin;
  k.id = next_id_++;
  k.hosted = 0;
  k.stamp_ns = stamp_ns;
  k.state = k.first = state;
  k.delta.setZero();
  std::swap(k.image, image);
  newest_ = slot;
  for (WindowPoint& point : points_) point.sight[static_cast<std::size_t>(slot)] = Sight::untried;
  if (origin) {
    for (int i = 6; i < state_size; ++i) prior_H_(slot * state_size + i, slot * state_size + i) = origin_information;
  }
  return slot;
}

bool Window::add_point(const Patch& patch, float prior_information, const Eigen::Vector3f& by_boresight) {
  if (points_.size() == points_.capacity()) return false;
  WindowPoint point;
  point.patch = patch;
  point.prior_depth = patch.inverse_depth - by_boresight.dot(boresight_.cast<float>());
  point.by_boresight = by_boresight;
  point.prior_information = prior_information;
  if (!take_template(keyframe(patch.host).image.level(0), patch.u, patch.v, config_.gradient_scale, point.look))
    return false;
  points_.push_back(point);
  ++keyframe(patch.host).hosted;
  return true;
}

void Window::update_state(Keyframe& k) {
  k.state.T_cw = se3_exp(k.delta.head<6>()) * k.first.T_cw;
  k.state.a = k.first.a + k.delta[6];
  k.state.b = k.first.b + k.delta[7];
}

Window::Vector Window::delta() const {
  Vector x = Vector::Zero();
  for (int i = 0; i < max_keyframes; ++i) {
    if (keyframe(i).used) x.segment<state_size>(i * state_size) = keyframe(i).delta;
  }
  x.tail<boresight_size>() = boresight_;
  return x;
}

void Window::apply(const Vector& step) {
  for (int i = 0; i < max_keyframes; ++i) {
    if (!keyframe(i).used) continue;
    keyframe(i).delta += step.segment<state_size>(i * state_size);
    update_state(keyframe(i));
  }
  boresight_ += step.tail<boresight_size>();
}

Window::Stats Window::optimise(int iterations) {
  Stats stats;
  for (PointSystem& system : systems_) system.marked = false;
  const int held = oldest();
  for (int iteration = 0; iteration < iterations; ++iteration) {
    linearise(false, 1e-4);
    sigma_ = std::clamp(static_cast<float>(std::sqrt(normal_.scale)), config_.min_sigma, config_.max_sigma);
    const Vector x = delta();
    Matrix H = normal_.H + prior_H_;
    Vector g = normal_.g + prior_g_ + prior_H_ * x;
    int active = 0;
    std::array<int, dimension> index{};
    for (int s = 0; s < max_keyframes; ++s) {
      if (!keyframe(s).used) continue;
      const int at = s * state_size;
      const double a_information = 1.0 / (config_.gain_sigma * config_.gain_sigma);
      const double b_information = 1.0 / (config_.offset_sigma * config_.offset_sigma);
      H(at + 6, at + 6) += a_information;
      g[at + 6] += a_information * keyframe(s).state.a;
      H(at + 7, at + 7) += b_information;
      g[at + 7] += b_information * keyframe(s).state.b;
      for (int k = s == held ? 6 : 0; k < state_size; ++k) index[static_cast<std::size_t>(active++)] = at + k;
    }
    for (int k = 0; k < boresight_size; ++k) index[static_cast<std::size_t>(active++)] = boresight_at + k;
    // Solve on the used slots, scaled to a unit diagonal.
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, dimension, dimension> A(active, active);
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, dimension, 1> b(active);
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, dimension, 1> scale(active);
    for (int r = 0; r < active; ++r) {
      const int ir = index[static_cast<std::size_t>(r)];
      scale[r] = 1.0 / std::sqrt(std::abs(H(ir, ir)) + 1e-6);
    }
    for (int r = 0; r < active; ++r) {
      for (int c = 0; c < active; ++c) {
        A(r, c) = scale[r] * scale[c] * H(index[static_cast<std::size_t>(r)], index[static_cast<std::size_t>(c)]);
      }
      A(r, r) *= 1.0 + 1e-5;
      b[r] = scale[r] * g[index[static_cast<std::size_t>(r)]];
    }
    const Eigen::LDLT<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, dimension, dimension>> factors(A);
    const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, dimension, 1> y = factors.solve(b);
    Vector step = Vector::Zero();
    for (int r = 0; r < active; ++r) step[index[static_cast<std::size_t>(r)]] = -scale[r] * y[r];
    if (!step.allFinite() || step.cwiseAbs().maxCoeff() > 1e4) {
      stats.ok = false;
      return stats;
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const PointSystem& system = systems_[i];
      if (!(system.H > 0.0F)) continue;
      Patch& patch = points_[i].patch;
      const double coupled = couplings_[i].cast<double>().dot(step);
      const auto change =
          static_cast<float>(-(static_cast<double>(system.g) + coupled) / static_cast<double>(system.H));
      const float old = patch.inverse_depth;
      patch.inverse_depth = std::clamp(old + std::clamp(change, -0.3F * old, 0.5F * old), 1e-4F, 1e3F);
      patch.slope_u *= patch.inverse_depth / old;
      patch.slope_v *= patch.inverse_depth / old;
    }
    apply(step);
    double moved = 0.0;
    for (int s = 0; s < max_keyframes; ++s) moved = std::max(moved, step.segment<6>(s * state_size).norm());
    if (moved >= 1e-5 && iteration + 1 < iterations) continue;
    Eigen::Matrix<double, Eigen::Dynamic, boresight_size, 0, dimension, boresight_size> unit(active, boresight_size);
    unit.setZero();
    unit.bottomRows<boresight_size>() = scale.tail<boresight_size>().asDiagonal();
    boresight_covariance_ =
        config_.correlation * (scale.asDiagonal() * factors.solve(unit)).bottomRows<boresight_size>();
    break;
  }
  linearise(false, 1e-4);
  stats.sigma = sigma_;
  stats.residuals = normal_.residuals;
  // What the pixels never confirm goes; what they do gets its uncertainty from them.
  for (std::size_t i = 0; i < points_.size(); ++i) {
    WindowPoint& point = points_[i];
    bool tried = false;
    for (int t = 0; t < max_keyframes; ++t) {
      const Sight sight = point.sight[static_cast<std::size_t>(t)];
      tried = tried || (keyframe(t).used && t != point.patch.host && (sight == Sight::outlier));
    }
    systems_[i].marked = point.good == 0 && tried;
    const double information =
        static_cast<double>(point.hessian) / config_.correlation + static_cast<double>(point.prior_information);
    if (information > 0.0) point.patch.sigma = static_cast<float>(1.0 / std::sqrt(information));
  }
  remove_marked();
  for (Keyframe& k : keyframes_) {
    if (!k.used || k.in_prior) continue;
    k.first = k.state;
    k.delta.setZero();
  }
  loosen_boresight();
  stats.points = static_cast<int>(points_.size());
  return stats;
}

// One step of its random walk in the prior: joins the next boresight to the last and eliminates the last.
void Window::loosen_boresight() {
  constexpr int n = boresight_size;
  const double stiffness = 1.0 / (config_.boresight_walk * config_.boresight_walk);
  const Eigen::Matrix3d inverse =
      (prior_H_.bottomRightCorner<n, n>() + stiffness * Eigen::Matrix3d::Identity()).inverse();
  const Eigen::Matrix<double, boresight_at, n> gain = prior_H_.topRightCorner<boresight_at, n>() * inverse;
  const Eigen::Vector3d g = prior_g_.tail<n>();
  prior_g_.head<boresight_at>() -= gain * g;
  prior_g_.tail<n>() = stiffness * inverse * g;
  prior_H_.topLeftCorner<boresight_at, boresight_at>() -=
      gain.lazyProduct(prior_H_.bottomLeftCorner<n, boresight_at>());
  prior_H_.topRightCorner<boresight_at, n>() = stiffness * gain;
  prior_H_.bottomLeftCorner<n, boresight_at>() = stiffness * gain.transpose();
  prior_H_.bottomRightCorner<n, n>() = stiffness * (Eigen::Matrix3d::Identity() - stiffness * inverse);
}

void Window::remove_marked() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (systems_[i].marked) continue;
    if (kept != i) points_[kept] = points_[i];
    ++kept;
  }
  points_.resize(kept);
  systems_.resize(kept);
  for (PointSystem& system : systems_) system.marked = false;
}

}  // namespace adit::thermal_odometry
