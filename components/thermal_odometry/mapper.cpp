#include "components/thermal_odometry/mapper.hpp"

#include <algorithm>
#include <cmath>

namespace adit::thermal_odometry {
namespace {

constexpr int occupied_size = 10;  // px: a point this near makes a new one superfluous
constexpr std::size_t capacity_factor = 4;

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::size_t capacity_for(int wanted) {
  return capacity_factor * static_cast<std::size_t>(std::max(200, wanted)) + 400;
}

}  // namespace

Mapper::Mapper(const CameraModel& camera, int levels, const Config& config)
    : camera_(pinhole_of(camera)),
      width_(camera.width),
      height_(camera.height),
      config_(config),
      selector_(camera.width, camera.height, config.selection),
      anchor_(camera_, camera.width, camera.height, config.max_cloud_points, config.anchor),
      clouds_(config.max_cloud_points, config.max_cloud_age_s),
      window_(camera_, capacity_for(config.selection.wanted), config.window) {
  (void)levels;
  columns_ = camera.width / cell_size + 1;
  rows_ = camera.height / cell_size + 1;
  cells_.resize(static_cast<std::size_t>(columns_ * rows_));
  occupied_.resize(static_cast<std::size_t>((camera.width / occupied_size + 1) * (camera.height / occupied_size + 1)));
  patches_.reserve(capacity_for(config.selection.wanted));
  scratch_.reserve(capacity_for(config.selection.wanted));
  for (int s = 0; s < max_keyframes; ++s) window_.keyframe(s).image.allocate(width_, height_);
}

void Mapper::clear() {
  window_.clear();
  anchored_map_ = false;
}

int Mapper::add_anchored(std::span<const Pixel> pixels, int slot) {
  int n = 0;
  for (const Pixel& pixel : pixels) {
    const auto depth = anchor_.depth_at(pixel.u, pixel.v);
    if (!depth) continue;
    const float loose = config_.lidar_looseness * depth->sigma;
    const Patch patch{pixel.u, pixel.v, depth->inverse_depth, depth->slope_u, depth->slope_v, depth->sigma, slot};
    // The plane m . X = 1 behind the pixel, inverse depth m . (x, y, 1), turns with the LiDAR: m -> m + rotation x m.
    const auto fx = static_cast<float>(camera_.fx);
    const auto fy = static_cast<float>(camera_.fy);
    const Eigen::Vector3f ray((pixel.u - static_cast<float>(camera_.cx)) / fx,
                              (pixel.v - static_cast<float>(camera_.cy)) / fy, 1.0F);
    Eigen::Vector3f plane(depth->slope_u * fx, depth->slope_v * fy, depth->inverse_depth);
    plane.z() -= plane.head<2>().dot(ray.head<2>());
    if (window_.add_point(patch, 1.0F / (loose * loose), plane.cross(ray))) ++n;
  }
  return n;
}

// Projects the window's points into the newest keyframe.
void Mapper::survey(int slot) {
  std::fill(cells_.begin(), cells_.end(), Cell{});
  std::fill(occupied_.begin(), occupied_.end(), std::uint8_t{0});
  std::array<Warp, max_keyframes> warps;
  for (int h = 0; h < max_keyframes; ++h) {
    if (window_.keyframe(h).used) {
      warps[static_cast<std::size_t>(h)] = Warp(window_.keyframe(h).state, window_.keyframe(slot).state, camera_);
    }
  }
  scratch_.clear();
  for (const WindowPoint& point : window_.points()) {
    if (point.patch.host == slot) continue;
    const Patch& patch = point.patch;
    const Warp& warp = warps[static_cast<std::size_t>(patch.host)];
    const Eigen::Vector3f X = warp.ray(patch.u, patch.v, patch.inverse_depth);
    if (!(X.z() > 0.05F)) continue;
    const Eigen::Vector2f p = warp.pixel(X);
    if (!(p.x() >= 0.0F && p.y() >= 0.0F && p.x() < static_cast<float>(width_) && p.y() < static_cast<float>(height_)))
      continue;
    const float d = patch.inverse_depth / X.z();
    scratch_.push_back(d);
    Cell& cell = cells_[static_cast<std::size_t>(static_cast<int>(p.y()) / cell_size * columns_ +
                                                 static_cast<int>(p.x()) / cell_size)];
    cell.low = cell.high < 0.0F ? d : std::min(cell.low, d);
    cell.high = std::max(cell.high, d);
    const int column = static_cast<int>(p.x()) / occupied_size;
    const int row = static_cast<int>(p.y()) / occupied_size;
    occupied_[static_cast<std::size_t>(row * (width_ / occupied_size + 1) + column)] = 1;
  }
  lowest_ = 0.05F;
  highest_ = 4.0F;
  if (scratch_.size() < 20) return;
  std::sort(scratch_.begin(), scratch_.end());
  lowest_ = 0.4F * scratch_[scratch_.size() / 20];
  highest_ = 2.0F * scratch_[scratch_.size() - 1 - scratch_.size() / 20];
}

int Mapper::add_matched(std::span<const Pixel> pixels, int slot, bool fill_all, float sigma) {
  std::array<ReferenceView, max_keyframes> views;
  for (int s = 0; s < max_keyframes; ++s) {
    if (s != slot && window_.keyframe(s).used) {
      views[static_cast<std::size_t>(s)] = {window_.keyframe(s).state, &window_.keyframe(s).image};
    }
  }
  const ReferenceView host{window_.keyframe(slot).state, &window_.keyframe(slot).image};
  int n = 0;
  for (const Pixel& pixel : pixels) {
    const int row = static_cast<int>(pixel.v) / occupied_size;
    const int column = static_cast<int>(pixel.u) / occupied_size;
    if (!fill_all && occupied_[static_cast<std::size_t>(row * (width_ / occupied_size + 1) + column)] != 0) continue;
    const int c = static_cast<int>(pixel.u) / cell_size;
    const int r = static_cast<int>(pixel.v) / cell_size;
    float low = 1e9F;
    float high = 0.0F;
    for (int y = std::max(0, r - 1); y <= std::min(rows_ - 1, r + 1); ++y) {
      for (int x = std::max(0, c - 1); x <= std::min(columns_ - 1, c + 1); ++x) {
        const Cell& cell = cells_[static_cast<std::size_t>(y * columns_ + x)];
        if (cell.high < 0.0F) continue;
        low = std::min(low, cell.low);
        high = std::max(high, cell.high);
      }
    }
    const DepthRange range = high > 0.0F ? DepthRange{0.6F * low, 1.6F * high} : DepthRange{lowest_, highest_};
    Patch patch;
    patch.u = pixel.u;
    patch.v = pixel.v;
    patch.host = slot;
    const auto found = search_depth(patch, host, views, camera_, range, sigma, config_.epipolar);
    if (found && window_.add_point(*found, 0.0F)) ++n;
  }
  return n;
}

// Median of ln(d_map / d_LiDAR) over points without LiDAR depth of their own, seen in the newest keyframe.
double Mapper::scale_offset(int slot, int* used) {
  scratch_.clear();
  for (const WindowPoint& point : window_.points()) {
    if (point.anchored() || point.patch.host == slot || point.good < 1) continue;
    const Warp warp(window_.keyframe(point.patch.host).state, window_.keyframe(slot).state, camera_);
    const Eigen::Vector3f X = warp.ray(point.patch.u, point.patch.v, point.patch.inverse_depth);
    if (!(X.z() > 0.05F)) continue;
    const Eigen::Vector2f p = warp.pixel(X);
    if (!(p.x() >= 0.0F && p.y() >= 0.0F && p.x() < static_cast<float>(width_ - 1) &&
          p.y() < static_cast<float>(height_ - 1)))
      continue;
    const auto depth = anchor_.depth_at(p.x(), p.y());
    if (depth) scratch_.push_back(std::log(point.patch.inverse_depth / X.z() / depth->inverse_depth));
  }
  *used = static_cast<int>(scratch_.size());
  return scratch_.empty() ? 0.0 : static_cast<double>(median(scratch_));
}

Mapper::Report Mapper::add_keyframe(std::int64_t stamp_ns, const CameraState& state, Pyramid& image,
                                    const Rectifier& rectifier, const PoseHistory& history, bool lidar, float sigma) {
  Report report;
  const std::span<const Pixel> pixels = selector_.select(image, rectifier);
  report.selected = static_cast<int>(pixels.size());
  const Eigen::Matrix3d boresight = so3_exp(window_.boresight());
  anchor_.project(lidar ? clouds_.at(stamp_ns, history, boresight) : std::span<const Eigen::Vector3f>{}, state.rate);
  for (const Pixel& pixel : pixels) report.anchored += anchor_.depth_at(pixel.u, pixel.v) ? 1 : 0;
  report.metric = report.anchored >= config_.min_points;
  const bool first = empty();
  report.textured = textured() && report.selected >= config_.min_points;
  if (first && (!report.metric || !report.textured)) return report;
  if (report.selected < config_.min_points / 3) return report;

  const int slot = window_.add_keyframe(stamp_ns, state, image);
  if (slot < 0) {
    report.failed = true;
    return report;
  }
  report.made = true;
  if (report.metric && !first && !anchored_map_) {
    int used = 0;
    const double offset = scale_offset(slot, &used);
    if (used >= 30) {
      window_.rescale(std::exp(offset));
      report.log_scale_correction = offset;
    }
  }
  if (report.metric) add_anchored(pixels, slot);
  if (!report.metric) {
    survey(slot);
    report.matched = add_matched(pixels, slot, false, sigma);
  }
  anchored_map_ = report.metric;
  if (config_.optimise || !report.metric) {
    const Window::Stats stats = window_.optimise(config_.window.iterations);
    report.sigma = stats.sigma;
    report.failed = !stats.ok;
    if (report.failed) return report;
  }
  trim(report.metric ? config_.anchored_keyframes : config_.mono_keyframes);
  return report;
}

Mapper::Report Mapper::start(std::int64_t first_stamp_ns, const CameraState& first, Pyramid& first_image,
                             std::span<const Patch> points, std::int64_t stamp_ns, const CameraState& state,
                             Pyramid& image, const Rectifier& rectifier, float sigma) {
  Report report;
  clear();
  const std::span<const Pixel> pixels = selector_.select(image, rectifier);
  report.selected = static_cast<int>(pixels.size());
  const int host = window_.add_keyframe(first_stamp_ns, first, first_image);
  for (Patch patch : points) {
    patch.host = host;
    window_.add_point(patch, 0.0F);
  }
  const int slot = window_.add_keyframe(stamp_ns, state, image);
  Window::Stats stats = window_.optimise(10);
  if (stats.ok) {
    survey(slot);
    report.matched = add_matched(pixels, slot, false, sigma);
    stats = window_.optimise(config_.window.iterations);
  }
  report.sigma = stats.sigma;
  report.failed = !stats.ok || stats.points < config_.min_points / 2;
  report.made = !report.failed;
  return report;
}

void Mapper::trim(int keep) {
  keep = std::clamp(keep, 2, max_keyframes - 1);
  if (config_.optimise) window_.retire_points();
  while (window_.count() > keep) {
    const int slot = window_.least_useful();
    if (slot < 0) break;
    window_.marginalise(slot);
  }
}

void Mapper::set_reference(Tracker& tracker) {
  std::array<ReferenceView, max_keyframes> views;
  for (int s = 0; s < max_keyframes; ++s) {
    const Keyframe& keyframe = window_.keyframe(s);
    if (keyframe.used) views[static_cast<std::size_t>(s)] = {keyframe.state, &keyframe.image};
  }
  const auto rank = [this](int slot) {
    int newer = 0;
    for (int s = 0; s < max_keyframes; ++s) {
      newer += window_.keyframe(s).used && window_.keyframe(s).id > window_.keyframe(slot).id ? 1 : 0;
    }
    return newer;
  };
  const int limit = anchored_map_ ? config_.anchored_views : max_keyframes;
  patches_.clear();
  for (const WindowPoint& point : window_.points()) {
    if (patches_.size() == patches_.capacity()) break;
    if (rank(point.patch.host) < limit) patches_.push_back(point.patch);
  }
  tracker.set_reference(views, patches_, window_.newest());
}

float Mapper::median_inverse_depth() const {
  scratch_.clear();
  for (const WindowPoint& point : window_.points()) scratch_.push_back(point.patch.inverse_depth);
  return scratch_.empty() ? 0.0F : median(scratch_);
}

}  // namespace adit::thermal_odometry
