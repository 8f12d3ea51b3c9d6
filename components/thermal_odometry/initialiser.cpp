#include "components/thermal_odometry/initialiser.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "components/thermal_odometry/patch_block.hpp"

namespace adit::thermal_odometry {
namespace {

constexpr float nu = 5.0F;
constexpr double clearly_better = 0.98;  // share of the energy below which another solution replaces the one found
constexpr std::array<int, Pyramid::max_levels> iterations_at{8, 10, 15, 25, 25};

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Initialiser::Initialiser(const Pinhole& camera, int width, int levels, std::size_t capacity, const Config& config)
    : camera_(camera), width_(width), levels_(levels), config_(config) {
  points_.reserve(capacity);
  backup_.reserve(capacity);
  for (Solution* solution : {&best_, &rival_}) {
    solution->depths.reserve(capacity);
    solution->anchors.reserve(capacity);
  }
  eliminations_.reserve(capacity);
  patches_.reserve(capacity);
  scratch_.reserve(capacity);
  for (auto& looks : looks_) looks.reserve(capacity);
}

void Initialiser::start(std::int64_t stamp_ns, Pyramid& image, std::span<const Pixel> pixels) {
  active_ = false;
  if (pixels.size() < 2 * neighbours + 1) return;
  std::swap(first_, image);
  stamp_ns_ = stamp_ns;
  points_.clear();
  for (const Pixel& pixel : pixels) {
    if (points_.size() == points_.capacity()) break;
    Point point;
    point.u = pixel.u;
    point.v = pixel.v;
    points_.push_back(point);
  }
  for (int l = 0; l < levels_; ++l) {
    auto& looks = looks_[static_cast<std::size_t>(l)];
    looks.resize(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      looks[i].weight.setZero();
      take_template(first_.level(l), at_level(points_[i].u, l), at_level(points_[i].v, l), config_.gradient_scale,
                    looks[i]);
    }
  }
  find_neighbours();
  state_ = {};
  spin_.setZero();
  last_ns_ = stamp_ns;
  velocity_.setZero();
  sigma_ = 2.0F;
  frames_ = 0;
  active_ = true;
}

void Initialiser::find_neighbours() {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    std::array<float, neighbours> distance;
    distance.fill(1e12F);
    for (std::size_t j = 0; j < points_.size(); ++j) {
      if (i == j) continue;
      const float du = points_[i].u - points_[j].u;
      const float dv = points_[i].v - points_[j].v;
      const float d2 = du * du + dv * dv;
      if (d2 >= distance.back()) continue;
      std::size_t at = neighbours - 1;
      for (; at > 0 && distance[at - 1] > d2; --at) {
        distance[at] = distance[at - 1];
        points_[i].near[at] = points_[i].near[at - 1];
      }
      distance[at] = d2;
      points_[i].near[at] = static_cast<int>(j);
    }
  }
}

Initialiser::System Initialiser::linearise(const Pyramid& pyramid, const CameraState& state, int level,
                                           double damping) {
  System system;
  system.H.setZero();
  system.g.setZero();
  const Image& image = pyramid.level(level);
  const Warp warp({}, state, camera_.at_level(level));
  const auto& looks = looks_[static_cast<std::size_t>(level)];
  const float inverse_sigma2 = 1.0F / (sigma_ * sigma_);
  eliminations_.resize(points_.size());
  PatchView view;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Point& point = points_[i];
    Elimination& elimination = eliminations_[i];
    elimination = {};
    point.good = false;
    const PatchTemplate& look = looks[i];
    const auto coupling = static_cast<float>(config_.coupling);
    const float lean = point.d - point.anchor;
    system.energy += static_cast<double>(coupling * lean * lean);
    elimination.H = coupling;
    elimination.g = coupling * lean;
    const bool visible = look.weight[0] > 0.0F && view_patch(image, warp, at_level(point.u, level),
                                                             at_level(point.v, level), point.d, 0.0F, 0.0F, view);
    if (!visible) {
      system.energy += 2.0 * pattern_size;
      continue;
    }
    const Pattern r = view.value - (warp.gain * look.intensity + warp.offset);
    const Pattern normalised = r.square() * inverse_sigma2;
    const Pattern robust = look.weight * (nu + 1.0F) / (nu + normalised);
    const Pattern w = robust * inverse_sigma2;
    // Energy of the t-distribution, so that accepting a step by it is consistent with the weights.
    system.energy += static_cast<double>((look.weight * (nu + 1.0F) * (1.0F + normalised / nu).log()).sum());
    system.scale += static_cast<double>((robust * r.square()).mean());
    ++system.residuals;
    point.energy = normalised.mean();
    point.good = point.energy < 6.0F;
    system.inliers += point.good ? 1 : 0;
    const Eigen::Matrix<float, 2, 6> J = pixel_jacobian(warp.fx, warp.fy, view.x, view.y, point.d * view.rho);
    const Eigen::Vector2f Jd = view.by_depth(warp);
    const PatchBlock block = patch_block(view, J, Jd, w, r, -warp.gain * look.intensity);
    // How the states move the patch: rows that are read later are turned further.
    Eigen::Matrix<float, states, 8> by = Eigen::Matrix<float, states, 8>::Identity();
    if (warp.rolling) {
      const float later = warp.row_time * (warp.fy * view.y + warp.cy - warp.middle_row);
      by.block<3, 3>(8, 3) = later * Eigen::Matrix3f::Identity();
    }
    elimination.c.noalias() = by * block.coupling;
    point.hessian = block.depth_H;
    elimination.H = (elimination.H + point.hessian) * static_cast<float>(1.0 + damping);
    elimination.g += block.depth_g;
    const float inverse = 1.0F / elimination.H;
    Eigen::Matrix<float, states, states> H = by * block.H * by.transpose();
    H.noalias() -= elimination.c * elimination.c.transpose() * inverse;
    Eigen::Matrix<float, states, 1> g = by * block.g;
    g.noalias() -= elimination.c * (elimination.g * inverse);
    system.H += H.cast<double>();
    system.g += g.cast<double>();
  }
  const double spin_information = 1.0 / (config_.spin_sigma * config_.spin_sigma);
  system.H.diagonal().tail<3>().array() += spin_information;
  system.g.tail<3>() += spin_information * spin_;
  system.energy += spin_information * spin_.squaredNorm();
  const double gain_information = 1.0 / (0.05 * 0.05);
  system.H(6, 6) += gain_information;
  system.g[6] += gain_information * state.a;
  system.energy += gain_information * state.a * state.a;
  if (system.residuals > 0) system.scale /= system.residuals;
  return system;
}

// What the rows of a rolling readout are moved by: the motion since the frame before, turning by `spin_` more.
void Initialiser::update_rate() {
  if (camera_.row_time == 0.0) return;
  state_.rate = se3_log(state_.T_cw * before_.inverse()) / dt_;
  state_.rate.tail<3>() += spin_;
}

void Initialiser::refine(const Pyramid& image, int level, int iterations) {
  double lambda = 0.01;
  System system = linearise(image, state_, level, lambda);
  int rejected = 0;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Matrix H = system.H;
    H.diagonal() *= 1.0 + lambda;
    H.diagonal().array() += 1e-6;
    const Vector step = -H.ldlt().solve(system.g);
    if (!step.allFinite() || step.head<6>().norm() > 2.0) return;
    backup_.clear();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Point& point = points_[i];
      backup_.push_back(point.d);
      const Elimination& e = eliminations_[i];
      const auto change =
          static_cast<float>(-(static_cast<double>(e.g) + e.c.cast<double>().dot(step)) / static_cast<double>(e.H));
      point.d = std::clamp(point.d + std::clamp(change, -0.4F * point.d, 0.6F * point.d), 0.02F, 30.0F);
    }
    const CameraState before = state_;
    const Eigen::Vector3d spin = spin_;
    state_.T_cw = se3_exp(step.head<6>()) * state_.T_cw;
    state_.a += step[6];
    state_.b += step[7];
    spin_ += step.tail<3>();
    update_rate();
    const System next = linearise(image, state_, level, lambda);
    if (next.energy < system.energy) {
      system = next;
      lambda = std::max(1e-4, 0.5 * lambda);
      rejected = 0;
      if (step.head<6>().norm() < 1e-5) break;
    } else {
      state_ = before;
      spin_ = spin;
      for (std::size_t i = 0; i < points_.size(); ++i) points_[i].d = backup_[i];
      lambda = std::min(1e3, 4.0 * lambda);
      if (++rejected >= 3) break;
      system = linearise(image, state_, level, lambda);
    }
  }
  system = linearise(image, state_, level, lambda);
  sigma_ = std::clamp(static_cast<float>(std::sqrt(system.scale)), config_.min_sigma, config_.max_sigma);
}

void Initialiser::refine_from_the_top(const Pyramid& image) {
  for (int level = std::min(levels_ - 1, 3); level >= 0; --level) {
    refine(image, level, iterations_at[static_cast<std::size_t>(level)]);
    lean_on_neighbours();
  }
}

void Initialiser::lean_on_neighbours() {
  for (Point& point : points_) {
    std::array<float, neighbours> depths;
    std::size_t n = 0;
    for (int j : point.near) {
      if (points_[static_cast<std::size_t>(j)].good) depths[n++] = points_[static_cast<std::size_t>(j)].d;
    }
    if (n < 3) continue;
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(n / 2);
    std::nth_element(depths.begin(), middle, depths.begin() + static_cast<std::ptrdiff_t>(n));
    point.anchor = 0.2F * (point.good ? point.d : *middle) + 0.8F * *middle;
    if (!point.good) point.d = point.anchor;
  }
}

// Median shift of the points by the translation alone, and how well the views agree.
void Initialiser::measure(const Pyramid& image) {
  const System system = linearise(image, state_, 0, 0.0);
  inlier_share_ = static_cast<float>(system.inliers) / static_cast<float>(std::max(1, system.residuals));
  visible_share_ = static_cast<float>(system.residuals) / static_cast<float>(points_.size());
  CameraState turned = state_;
  turned.T_cw.translation().setZero();
  const Warp full({}, state_, camera_);
  const Warp rotation({}, turned, camera_);
  scratch_.clear();
  for (const Point& point : points_) {
    const Eigen::Vector3f a = full.ray(point.u, point.v, point.d);
    const Eigen::Vector3f b = rotation.ray(point.u, point.v, point.d);
    if (a.z() > 0.05F && b.z() > 0.05F) scratch_.push_back((full.pixel(a) - rotation.pixel(b)).norm());
  }
  parallax_ = scratch_.empty() ? 0.0F : median(scratch_);
}

Initialiser::Outcome Initialiser::add(std::int64_t stamp_ns, const Pyramid& image) {
  if (!active_ || stamp_ns <= last_ns_) return Outcome::lost;
  ++frames_;
  dt_ = 1e-9 * static_cast<double>(stamp_ns - last_ns_);
  last_ns_ = stamp_ns;
  before_ = state_.T_cw;
  spin_.setZero();
  state_.T_cw = se3_exp(velocity_ * dt_) * state_.T_cw;
  update_rate();
  // The brightness offset first: a median is safe from anything the geometry does.
  {
    const int top = levels_ - 1;
    const Warp warp({}, state_, camera_.at_level(top));
    scratch_.clear();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const PatchTemplate& look = looks_[static_cast<std::size_t>(top)][i];
      if (look.weight[0] == 0.0F) continue;
      const Eigen::Vector3f X = warp.ray(at_level(points_[i].u, top), at_level(points_[i].v, top), points_[i].d);
      if (!(X.z() > 0.05F)) continue;
      const Eigen::Vector2f p = warp.pixel(X);
      if (samplable(image.level(top), p.x(), p.y())) {
        scratch_.push_back(sample_value(image.level(top), p.x(), p.y()) -
                           (warp.gain * look.intensity.mean() + warp.offset));
      }
    }
    if (!scratch_.empty()) state_.b += median(scratch_);
  }
  refine_from_the_top(image);
  measure(image);
  velocity_ = se3_log(state_.T_cw * before_.inverse()) / dt_;
  const bool finite = state_.T_cw.matrix().allFinite();
  const bool agree = finite && inlier_share_ > 0.4F && visible_share_ > 0.4F;
  if (!agree || parallax_ > config_.max_flow * static_cast<float>(width_)) return Outcome::lost;
  const bool enough = parallax_ > config_.min_parallax * static_cast<float>(width_) && frames_ >= config_.min_frames;
  if (!enough || !(inlier_share_ > config_.min_inlier_share)) return Outcome::waiting;
  if (!beaten_by_a_rival(image)) return Outcome::done;
  frames_ = config_.min_frames / 2;  // the better one has to prove itself, too
  velocity_.setZero();
  return Outcome::waiting;
}

// Two views of little parallax have several solutions that look alike: a turn taken for a step aside, depth inside out.
// Faint texture, whose depths stay near where they began, is held by the wrong one. So the others are tried: along
// every axis, without a turn, from flat depth. True: one was clearly better and has replaced the one found.
bool Initialiser::beaten_by_a_rival(const Pyramid& image) {
  const float sigma = sigma_;  // energies are comparable in one unit
  store(image, best_);
  const CameraState found = state_;
  const double step = found.T_cw.translation().norm();
  bool beaten = false;
  for (int i = 0; i < 6; ++i) {
    state_ = found;
    state_.T_cw = Pose::Identity();
    state_.T_cw.translation()[i / 2] = i % 2 == 0 ? -step : step;
    spin_.setZero();
    update_rate();
    for (Point& point : points_) point.d = point.anchor = 1.0F;
    refine_from_the_top(image);
    sigma_ = sigma;
    store(image, rival_);
    if (!(rival_.energy < clearly_better * best_.energy)) continue;
    std::swap(rival_, best_);
    beaten = true;
  }
  state_ = best_.state;
  spin_ = best_.spin;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    points_[i].d = best_.depths[i];
    points_[i].anchor = best_.anchors[i];
  }
  measure(image);
  return beaten;
}

void Initialiser::store(const Pyramid& image, Solution& out) {
  out.state = state_;
  out.spin = spin_;
  out.energy = linearise(image, state_, 0, 0.0).energy;
  out.depths.clear();
  out.anchors.clear();
  for (const Point& point : points_) {
    out.depths.push_back(point.d);
    out.anchors.push_back(point.anchor);
  }
}

std::span<const Patch> Initialiser::patches() {
  patches_.clear();
  for (const Point& point : points_) {
    if (!point.good || !(point.hessian > 0.0F)) continue;
    Patch patch;
    patch.u = point.u;
    patch.v = point.v;
    patch.inverse_depth = point.d;
    patch.sigma = std::sqrt(3.0F / point.hessian);
    if (patch.sigma > config_.max_relative_sigma * point.d) continue;
    patches_.push_back(patch);
  }
  return patches_;
}

}  // namespace adit::thermal_odometry
