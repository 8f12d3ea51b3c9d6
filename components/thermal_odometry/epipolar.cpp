#include "components/thermal_odometry/epipolar.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace adit::thermal_odometry {
namespace {

constexpr int max_views = 3;
constexpr int max_steps = 96;

struct Candidate {
  Warp warp;
  const Image* image = nullptr;
  float parallax = 0.0F;
};

// Mean squared residual of the patch in one view, limited per pixel; negative if it is not visible.
float patch_cost(const Candidate& view, const PatchTemplate& look, float u, float v, float d, float inverse_sigma2) {
  const Image& image = *view.image;
  float sum = 0.0F;
  const Eigen::Vector3f centre = view.warp.ray(u, v, d);
  if (!(centre.z() > 0.05F)) return -1.0F;
  for (int k = 0; k < pattern_size; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Eigen::Vector3f X = centre + pattern_x[i] * view.warp.step_u + pattern_y[i] * view.warp.step_v;
    if (!(X.z() > 0.05F)) return -1.0F;
    const Eigen::Vector2f p = view.warp.pixel(X);
    if (!samplable(image, p.x(), p.y())) return -1.0F;
    const float r = sample_value(image, p.x(), p.y()) - (view.warp.gain * look.intensity[k] + view.warp.offset);
    sum += std::min(look.weight[k] * r * r * inverse_sigma2, 16.0F);
  }
  return sum / pattern_size;
}

}  // namespace

std::optional<Patch> search_depth(const Patch& patch, const ReferenceView& host, std::span<const ReferenceView> views,
                                  const Pinhole& camera, const DepthRange& range, float sigma,
                                  const EpipolarConfig& config) {
  PatchTemplate look;
  if (!take_template(host.image->level(0), patch.u, patch.v, 20.0F, look)) return std::nullopt;
  // The views with the longest baseline that still see both ends of the range.
  std::array<Candidate, max_views> chosen;
  int count = 0;
  for (const ReferenceView& view : views) {
    if (view.image == nullptr) continue;
    Candidate candidate{Warp(host.state, view.state, camera), &view.image->level(0), 0.0F};
    const Eigen::Vector3f near = candidate.warp.ray(patch.u, patch.v, range.max_inverse);
    const Eigen::Vector3f far = candidate.warp.ray(patch.u, patch.v, range.min_inverse);
    if (!(near.z() > 0.05F && far.z() > 0.05F)) continue;
    const Eigen::Vector2f from = candidate.warp.pixel(near);
    const Eigen::Vector2f to = candidate.warp.pixel(far);
    if (!samplable(*candidate.image, to.x(), to.y())) continue;
    candidate.parallax = (from - to).norm();
    if (count < max_views) {
      chosen[static_cast<std::size_t>(count++)] = candidate;
      continue;
    }
    const auto shortest = std::min_element(
        chosen.begin(), chosen.end(), [](const Candidate& a, const Candidate& b) { return a.parallax < b.parallax; });
    if (candidate.parallax > shortest->parallax) *shortest = candidate;
  }
  float parallax = 0.0F;
  for (int i = 0; i < count; ++i) parallax = std::max(parallax, chosen[static_cast<std::size_t>(i)].parallax);
  if (parallax < config.min_parallax) return std::nullopt;

  const float inverse_sigma2 = 1.0F / (sigma * sigma);
  const int steps = std::clamp(static_cast<int>(parallax) + 1, 4, std::min(config.max_steps, max_steps - 1));
  std::array<float, max_steps> costs;
  int best = -1;
  for (int s = 0; s <= steps; ++s) {
    const float d =
        range.min_inverse + (range.max_inverse - range.min_inverse) * static_cast<float>(s) / static_cast<float>(steps);
    float sum = 0.0F;
    int seen = 0;
    for (int i = 0; i < count; ++i) {
      const float cost = patch_cost(chosen[static_cast<std::size_t>(i)], look, patch.u, patch.v, d, inverse_sigma2);
      if (cost < 0.0F) continue;
      sum += cost;
      ++seen;
    }
    costs[static_cast<std::size_t>(s)] = seen > 0 ? sum / static_cast<float>(seen) : std::numeric_limits<float>::max();
    if (seen > 0 && (best < 0 || costs[static_cast<std::size_t>(s)] < costs[static_cast<std::size_t>(best)])) best = s;
  }
  if (best < 0 || costs[static_cast<std::size_t>(best)] > 2.0F * config.max_cost) return std::nullopt;
  float second = std::numeric_limits<float>::max();
  for (int s = 0; s <= steps; ++s) {
    if (std::abs(s - best) > 2) second = std::min(second, costs[static_cast<std::size_t>(s)]);
  }
  const float floor = costs[static_cast<std::size_t>(best)] + 0.2F;
  if (second < config.min_ratio * floor) return std::nullopt;

  Patch found = patch;
  found.slope_u = found.slope_v = 0.0F;
  found.inverse_depth = range.min_inverse +
                        (range.max_inverse - range.min_inverse) * static_cast<float>(best) / static_cast<float>(steps);
  const float step_limit = (range.max_inverse - range.min_inverse) / static_cast<float>(steps);
  PatchView view;
  float hessian = 0.0F;
  float energy = 0.0F;
  for (int iteration = 0; iteration < 4; ++iteration) {
    float H = 0.0F;
    float g = 0.0F;
    float e = 0.0F;
    int pixels = 0;
    for (int i = 0; i < count; ++i) {
      const Candidate& c = chosen[static_cast<std::size_t>(i)];
      if (!view_patch(*c.image, c.warp, found.u, found.v, found.inverse_depth, 0.0F, 0.0F, view)) continue;
      const Pattern r = view.value - (c.warp.gain * look.intensity + c.warp.offset);
      const Eigen::Vector2f by_depth = view.by_depth(c.warp);
      const Pattern j = view.gx * by_depth.x() + view.gy * by_depth.y();
      const Pattern normalised = r.square() * inverse_sigma2;
      const Pattern w = look.weight * 6.0F / (5.0F + normalised) * inverse_sigma2;
      H += (w * j.square()).sum();
      g += (w * j * r).sum();
      e += (look.weight * normalised).min(16.0F).sum();
      pixels += pattern_size;
    }
    if (pixels == 0 || !(H > 0.0F)) return std::nullopt;
    hessian = H;
    energy = e / static_cast<float>(pixels);
    const float step = std::clamp(-g / H, -step_limit, step_limit);
    found.inverse_depth += step;
    if (!(found.inverse_depth > 1e-5F)) return std::nullopt;
    if (std::abs(step) < 1e-3F * found.inverse_depth) break;
  }
  found.sigma = static_cast<float>(std::sqrt(config.correlation / static_cast<double>(hessian)));
  if (energy > config.max_cost || found.sigma > config.max_relative_sigma * found.inverse_depth) return std::nullopt;
  return found;
}

}  // namespace adit::thermal_odometry
