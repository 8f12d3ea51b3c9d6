#include "components/mapping/section.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

namespace adit::mapping {
namespace {

constexpr float radius_scale = 0.2F;         // m: what counts as a strong feature of the wall
constexpr float reflectivity_scale = 0.25F;  // of the mean reflectivity
constexpr float strongest = 3.0F;            // of either: an open door does not outvote everything else
constexpr float two_pi = 2.0F * std::numbers::pi_v<float>;

float angle_of(std::size_t sector) {
  return (static_cast<float>(sector) + 0.5F) * two_pi / sectors;
}

// Left is right when driven the other way.
std::size_t mirrored(std::size_t sector) {
  return (sectors / 2 + sectors - 1 - sector) % sectors;
}

}  // namespace

std::vector<Section> cut_sections(std::span<const Point> points, const Pose& from, const Pose& to, std::size_t count,
                                  double reach) {
  std::vector<Section> cut(count);
  const Eigen::Vector3f start = from.translation().cast<float>();
  const Eigen::Vector3f way = (to.translation() - from.translation()).cast<float>();
  const float length2 = way.squaredNorm();
  if (length2 < 1e-6F || count == 0) return cut;
  std::vector<Eigen::Isometry3f> back(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double fraction = (static_cast<double>(k) + 0.5) / static_cast<double>(count);
    back[k] = se3_interpolate(from, to, fraction).inverse().cast<float>();
  }
  std::vector<std::array<float, sectors>> hits(count, std::array<float, sectors>{});
  const auto reach2 = static_cast<float>(reach * reach);
  for (const Point& point : points) {
    const Eigen::Vector3f offset = point.position - start;
    const float fraction = offset.dot(way) / length2;
    if (!(fraction >= 0.0F) || fraction >= 1.0F) continue;
    const auto k = static_cast<std::size_t>(fraction * static_cast<float>(count));
    const Eigen::Vector3f p = back[k] * point.position;
    const float r2 = p.y() * p.y() + p.z() * p.z();
    if (r2 > reach2) continue;
    float angle = std::atan2(p.z(), p.y());
    if (angle < 0.0F) angle += two_pi;
    const std::size_t s = std::min(sectors - 1, static_cast<std::size_t>(angle / two_pi * sectors));
    cut[k].radius[s] += std::sqrt(r2);
    cut[k].reflectivity[s] += point.intensity;
    hits[k][s] += 1.0F;
  }
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t s = 0; s < sectors; ++s) {
      if (hits[k][s] == 0.0F) continue;
      cut[k].radius[s] /= hits[k][s];
      cut[k].reflectivity[s] /= hits[k][s];
    }
  }
  return cut;
}

Eigen::Vector2d offset_between(std::span<const Section> of, std::span<const Section> from, bool reversed) {
  // A step d off the other path shortens the radius towards it: r_of - r_from = -d . (cos, sin), by least squares.
  constexpr float same_wall = 3.0F;  // m: more is another wall
  Eigen::Matrix2d a = 1e-3 * Eigen::Matrix2d::Identity();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (std::size_t s = 0; s < sectors; ++s) {
    const auto mean = [](std::span<const Section> sections, std::size_t sector) {
      float sum = 0.0F, count = 0.0F;
      for (const Section& section : sections) {
        sum += section.radius[sector];
        count += section.radius[sector] > 0.0F ? 1.0F : 0.0F;
      }
      return count > 0.0F ? sum / count : 0.0F;
    };
    // In the axes of `from`.
    const float r_of = mean(of, reversed ? mirrored(s) : s), r_from = mean(from, s);
    if (r_of == 0.0F || r_from == 0.0F || std::abs(r_of - r_from) > same_wall) continue;
    const Eigen::Vector2d direction(std::cos(angle_of(s)), std::sin(angle_of(s)));
    a += direction * direction.transpose();
    b -= direction * static_cast<double>(r_of - r_from);
  }
  return a.ldlt().solve(b);
}

void SectionHistory::add(const Section& section) {
  raw_.push_back(section);
  run_of_.push_back(static_cast<std::uint32_t>(run_begin_));
  if (raw_.size() <= config_.smoothing) return;
  features_.push_back(feature(features_.size()));
  double squares = 0.0;
  for (const float value : features_.back()) squares += static_cast<double>(value) * static_cast<double>(value);
  energy_.push_back(energy_.back() + squares);
}

SectionHistory::Feature SectionHistory::feature(std::size_t i) const {
  const std::size_t first = i > config_.smoothing ? i - config_.smoothing : 0;
  const std::size_t last = std::min(raw_.size() - 1, i + config_.smoothing);
  Feature out{};
  for (std::size_t s = 0; s < sectors; ++s) {
    if (raw_[i].radius[s] == 0.0F) continue;
    float radius = 0.0F, reflectivity = 0.0F, count = 0.0F;
    for (std::size_t k = first; k <= last; ++k) {
      if (raw_[k].radius[s] == 0.0F) continue;
      radius += raw_[k].radius[s];
      reflectivity += raw_[k].reflectivity[s];
      count += 1.0F;
    }
    radius /= count;
    reflectivity /= count;
    const auto scaled = [](float value, float scale) { return std::clamp(value / scale, -strongest, strongest); };
    out[s] = scaled(raw_[i].radius[s] - radius, radius_scale);
    if (reflectivity > 0.0F) {
      out[sectors + s] = scaled(raw_[i].reflectivity[s] - reflectivity, reflectivity_scale * reflectivity);
    }
  }
  return out;
}

double SectionHistory::energy(std::size_t first) const {
  return energy_[first + config_.window] - energy_[first];
}

bool SectionHistory::holds_window(std::size_t end) const {
  return end < features_.size() && end + 1 >= run_of_[end] + config_.window;
}

bool SectionHistory::has_contrast(double energy) const {
  const auto values = static_cast<double>(config_.window * 2 * sectors);
  return energy > config_.least_contrast * config_.least_contrast * values;
}

std::vector<SectionHistory::Feature> SectionHistory::window(std::size_t end, bool reversed) const {
  const auto first = features_.begin() + static_cast<std::ptrdiff_t>(end + 1 - config_.window);
  std::vector<Feature> out(first, first + static_cast<std::ptrdiff_t>(config_.window));
  if (!reversed) return out;
  std::reverse(out.begin(), out.end());
  for (Feature& feature : out) {
    const Feature straight = feature;
    for (std::size_t s = 0; s < sectors; ++s) {
      feature[mirrored(s)] = straight[s];
      feature[sectors + mirrored(s)] = straight[sectors + s];
    }
  }
  return out;
}

std::optional<double> SectionHistory::correlate(const std::vector<Feature>& window, double window_energy,
                                                std::size_t other, bool reversed) const {
  const std::size_t n = config_.window;
  if (!holds_window(reversed ? other + n - 1 : other)) return std::nullopt;
  const std::size_t first = reversed ? other : other + 1 - n;
  const double other_energy = energy(first);
  if (!has_contrast(other_energy)) return std::nullopt;
  double sum = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    float dot = 0.0F;
    for (std::size_t s = 0; s < 2 * sectors; ++s) dot += window[k][s] * features_[first + k][s];
    sum += static_cast<double>(dot);
  }
  return sum / std::sqrt(window_energy * other_energy);
}

std::optional<double> SectionHistory::correlate(std::size_t end, std::size_t other, bool reversed) const {
  if (!holds_window(end)) return std::nullopt;
  const double mine = energy(end + 1 - config_.window);
  return has_contrast(mine) ? correlate(window(end, reversed), mine, other, reversed) : std::nullopt;
}

std::vector<SectionMatch> SectionHistory::search(std::size_t end, std::size_t before, std::size_t most) const {
  std::vector<SectionMatch> all;
  if (!holds_window(end)) return all;
  const double mine = energy(end + 1 - config_.window);
  if (!has_contrast(mine)) return all;
  for (const bool reversed : {false, true}) {
    const std::vector<Feature> window = this->window(end, reversed);
    for (std::size_t other = 0; other < before; ++other) {
      const std::optional<double> score = correlate(window, mine, other, reversed);
      if (score && *score > 0.0) all.push_back({other, reversed, *score});
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  std::vector<SectionMatch> peaks;
  for (const SectionMatch& match : all) {
    const bool beside = std::any_of(peaks.begin(), peaks.end(), [&](const SectionMatch& p) {
      return p.reversed == match.reversed && std::max(p.end, match.end) - std::min(p.end, match.end) < config_.apart;
    });
    if (beside) continue;
    peaks.push_back(match);
    if (peaks.size() == most) break;
  }
  return peaks;
}

}  // namespace adit::mapping
