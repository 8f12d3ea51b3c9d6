#include "components/thermal_odometry/window.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace adit::thermal_odometry {
namespace {

using Block = Eigen::Matrix<double, state_size, state_size>;
using Relative8 = Eigen::Matrix<float, state_size, 1>;

constexpr double origin_information = 1e10;  // holds the first keyframe

// Geometry of a host and a target: the warp at the current state for values, the one at first estimates for Jacobians,
// and how a relative increment follows from the two absolute ones.
struct Pair {
  Warp current;
  Warp first;
  Block to_host;  // relative = to_host host + target
  Block H = Block::Zero();
  Eigen::Matrix<double, state_size, 1> g = Eigen::Matrix<double, state_size, 1>::Zero();
  bool touched = false;

  void set(const Keyframe& host, const Keyframe& target, const Pinhole& camera) {
    current = Warp(host.state, target.state, camera);
    first = Warp(host.first, target.first, camera);
    to_host.setZero();
    to_host.topLeftCorner<6, 6>() = -se3_adjoint(target.first.T_cw * host.first.T_cw.inverse());
    to_host(6, 6) = -1.0;
    to_host(7, 7) = -static_cast<double>(current.gain);
    H.setZero();
    g.setZero();
    touched = false;
  }
};

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

Window::Window(const Pinhole& camera, std::size_t capacity, const Config& config) : camera_(camera), config_(config) {
  points_.reserve(capacity);
  systems_.reserve(capacity);
  couplings_.resize(capacity);
}

void Window::clear() {
  for (Keyframe& keyframe : keyframes_) {
    keyframe.used = false;
    keyframe.in_prior = false;
  }
  newest_ = -1;
  points_.clear();
  prior_H_.setZero();
  prior_g_.setZero();
  sigma_ = 1.5F;
}

int Window::free_slot() const {
  for (int i = 0; i < max_keyframes; ++i) {
    if (!keyframe(i).used) return i;
  }
  return -1;
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
  k.stamp_ns = stamp_ns;
  k.state = k.first = state;
  k.delta.setZero();
  std::swap(k.image, image);
  newest_ = slot;
  for (WindowPoint& point : points_) point.sight[static_cast<std::size_t>(slot)] = Sight::untried;
  if (origin) {
    for (int i = 0; i < state_size; ++i) prior_H_(slot * state_size + i, slot * state_size + i) = origin_information;
  }
  return slot;
}

bool Window::add_point(const Patch& patch, float prior_information) {
  if (points_.size() == points_.capacity()) return false;
  WindowPoint point;
  point.patch = patch;
  point.prior_depth = patch.inverse_depth;
  point.prior_information = prior_information;
  if (!take_template(keyframe(patch.host).image.level(0), patch.u, patch.v, config_.gradient_scale, point.look))
    return false;
  points_.push_back(point);
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
  return x;
}

void Window::apply(const Vector& step) {
  for (int i = 0; i < max_keyframes; ++i) {
    if (!keyframe(i).used) continue;
    keyframe(i).delta += step.segment<state_size>(i * state_size);
    update_state(keyframe(i));
  }
}

const Window::Normal& Window::linearise(bool only_marked, double depth_damping) {
  std::array<std::array<Pair, max_keyframes>, max_keyframes> pairs;
  for (int h = 0; h < max_keyframes; ++h) {
    for (int t = 0; t < max_keyframes; ++t) {
      if (h != t && keyframe(h).used && keyframe(t).used) {
        pairs[static_cast<std::size_t>(h)][static_cast<std::size_t>(t)].set(keyframe(h), keyframe(t), camera_);
      }
    }
  }
  normal_.H.setZero();
  normal_.g.setZero();
  normal_.energy = 0.0;
  normal_.scale = 0.0;
  normal_.residuals = 0;
  systems_.resize(points_.size());
  const float inverse_sigma2 = 1.0F / (sigma_ * sigma_);
  const float nu = config_.nu;
  PatchView view;
  std::array<int, max_keyframes> seen{};

  for (std::size_t i = 0; i < points_.size(); ++i) {
    WindowPoint& point = points_[i];
    PointSystem& system = systems_[i];
    if (only_marked && !system.marked) continue;
    const Patch& patch = point.patch;
    auto& coupling = couplings_[i];
    coupling.setZero();
    system.H = 0.0F;
    system.g = 0.0F;
    point.good = 0;
    int targets = 0;
    const auto host = static_cast<std::size_t>(patch.host);
    for (int t = 0; t < max_keyframes; ++t) {
      if (t == patch.host || !keyframe(t).used) continue;
      Sight& sight = point.sight[static_cast<std::size_t>(t)];
      Pair& pair = pairs[host][static_cast<std::size_t>(t)];
      const bool visible = view_patch(keyframe(t).image.level(0), pair.current, patch.u, patch.v, patch.inverse_depth,
                                      patch.slope_u, patch.slope_v, view);
      if (!visible) {
        sight = Sight::outside;
        continue;
      }
      const Pattern r = view.value - (pair.current.gain * point.look.intensity + pair.current.offset);
      const Pattern normalised = r.square() * inverse_sigma2;
      const float patch_energy = (point.look.weight * normalised).mean();
      if (patch_energy > config_.outlier) {
        sight = Sight::outlier;
        normal_.energy += config_.outlier;
        continue;
      }
      sight = Sight::in;
      ++point.good;
      ++normal_.residuals;
      const Pattern robust = point.look.weight * (nu + 1.0F) / (nu + normalised);
      const Pattern w = robust * inverse_sigma2;
      normal_.scale += static_cast<double>((robust * r.square()).mean());
      normal_.energy += static_cast<double>((robust * normalised).mean());

      // Geometry at the first estimates, once a patch; image gradients at the current state.
      const Eigen::Vector3f X = pair.first.ray(patch.u, patch.v, patch.inverse_depth);
      if (!(X.z() > 0.05F)) continue;
      view.rho = 1.0F / X.z();
      view.x = X.x() * view.rho;
      view.y = X.y() * view.rho;
      const Eigen::Matrix<float, 2, 6> J =
          pixel_jacobian(pair.first.fx, pair.first.fy, view.x, view.y, patch.inverse_depth * view.rho);
      const Eigen::Vector2f Jd = view.by_depth(pair.first);
      const auto host_b = static_cast<float>(keyframe(patch.host).state.b);
      const Pattern ja = -pair.current.gain * (point.look.intensity - host_b);
      const Pattern wgx = w * view.gx;
      const Pattern wgy = w * view.gy;
      Eigen::Matrix2f G;
      G(0, 0) = (wgx * view.gx).sum();
      G(0, 1) = G(1, 0) = (wgx * view.gy).sum();
      G(1, 1) = (wgy * view.gy).sum();
      const Eigen::Vector2f gr((wgx * r).sum(), (wgy * r).sum());
      Eigen::Matrix2f affine;
      affine << (wgx * ja).sum(), -wgx.sum(), (wgy * ja).sum(), -wgy.sum();
      Eigen::Matrix<float, state_size, state_size> H;
      H.topLeftCorner<6, 6>().noalias() = J.transpose() * (G * J);
      H.topRightCorner<6, 2>().noalias() = J.transpose() * affine;
      H.bottomLeftCorner<2, 6>() = H.topRightCorner<6, 2>().transpose();
      H(6, 6) = (w * ja.square()).sum();
      H(6, 7) = H(7, 6) = -(w * ja).sum();
      H(7, 7) = w.sum();
      Relative8 g;
      g.head<6>().noalias() = J.transpose() * gr;
      g[6] = (w * ja * r).sum();
      g[7] = -(w * r).sum();
      pair.H += H.cast<double>();
      pair.g += g.cast<double>();
      pair.touched = true;
      Relative8 c;
      const Eigen::Vector2f GJd = G * Jd;
      c.head<6>().noalias() = J.transpose() * GJd;
      c.tail<2>().noalias() = affine.transpose() * Jd;
      system.H += Jd.dot(GJd);
      system.g += Jd.dot(gr);
      coupling.segment<state_size>(t * state_size) = c;
      coupling.segment<state_size>(patch.host * state_size).noalias() += pair.to_host.cast<float>().transpose() * c;
      seen[static_cast<std::size_t>(targets++)] = t;
    }
    point.hessian = system.H;
    system.H += point.prior_information;
    system.g += point.prior_information * (patch.inverse_depth - point.prior_depth);
    system.H *= static_cast<float>(1.0 + depth_damping);
    if (targets == 0 || !(system.H > 1e-6F)) {
      system.H = 0.0F;
      continue;
    }
    seen[static_cast<std::size_t>(targets++)] = patch.host;
    // Eliminating the depth: a rank-one update on the blocks of the keyframes that see the point.
    const double inverse = 1.0 / static_cast<double>(system.H);
    for (int a = 0; a < targets; ++a) {
      const int ra = seen[static_cast<std::size_t>(a)] * state_size;
      const Eigen::Matrix<double, state_size, 1> ca = coupling.segment<state_size>(ra).cast<double>() * inverse;
      normal_.g.segment<state_size>(ra) -= ca * static_cast<double>(system.g);
      for (int b = 0; b < targets; ++b) {
        const int rb = seen[static_cast<std::size_t>(b)] * state_size;
        if (rb > ra) continue;
        normal_.H.block<state_size, state_size>(ra, rb).noalias() -=
            ca.lazyProduct(coupling.segment<state_size>(rb).cast<double>().transpose());
      }
    }
  }
  // Lower triangle so far; the pairs' blocks are stitched into it with their adjoints.
  for (int h = 0; h < max_keyframes; ++h) {
    for (int t = 0; t < max_keyframes; ++t) {
      if (h == t || !keyframe(h).used || !keyframe(t).used) continue;
      const Pair& pair = pairs[static_cast<std::size_t>(h)][static_cast<std::size_t>(t)];
      if (!pair.touched) continue;
      const int rh = h * state_size;
      const int rt = t * state_size;
      const Block cross = pair.to_host.transpose().lazyProduct(pair.H);
      normal_.H.block<state_size, state_size>(rh, rh) += cross.lazyProduct(pair.to_host);
      normal_.H.block<state_size, state_size>(rt, rt) += pair.H;
      if (rh > rt) {
        normal_.H.block<state_size, state_size>(rh, rt) += cross;
      } else {
        normal_.H.block<state_size, state_size>(rt, rh) += cross.transpose();
      }
      normal_.g.segment<state_size>(rh) += pair.to_host.transpose() * pair.g;
      normal_.g.segment<state_size>(rt) += pair.g;
    }
  }
  for (int r = 0; r < dimension; ++r) {
    for (int c = r + 1; c < dimension; ++c) normal_.H(r, c) = normal_.H(c, r);
  }
  if (normal_.residuals > 0) normal_.scale /= normal_.residuals;
  return normal_;
}

Window::Stats Window::optimise(int iterations) {
  Stats stats;
  for (PointSystem& system : systems_) system.marked = false;
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
      for (int k = 0; k < state_size; ++k) index[static_cast<std::size_t>(active++)] = at + k;
    }
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
    const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, dimension, 1> y = A.ldlt().solve(b);
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
    if (moved < 1e-5) break;
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
  stats.points = static_cast<int>(points_.size());
  return stats;
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
  prior_H_ += config_.marginal_weight * normal_.H;
  prior_g_ += config_.marginal_weight * (normal_.g - normal_.H * x);
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
  int worst = -1;
  double worst_score = -1.0;
  for (int i = 0; i < max_keyframes; ++i) {
    if (!keyframe(i).used || i == newest_ || i == second) continue;
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
  }
  prior_H_ = inverse.asDiagonal() * prior_H_ * inverse.asDiagonal();
  prior_g_ = inverse.asDiagonal() * prior_g_;
  for (WindowPoint& point : points_) {
    const auto f = static_cast<float>(1.0 / factor);
    for (float* value : {&point.patch.inverse_depth, &point.patch.slope_u, &point.patch.slope_v, &point.patch.sigma,
                         &point.prior_depth}) {
      *value *= f;
    }
    point.prior_information /= f * f;
  }
}

}  // namespace adit::thermal_odometry
