#include "components/thermal_odometry/camera.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace adit::thermal_odometry {

Pinhole Pinhole::at_level(int level) const {
  const double scale = 1.0 / static_cast<double>(1 << level);
  return {fx * scale,
          fy * scale,
          (cx + 0.5) * scale - 0.5,
          (cy + 0.5) * scale - 0.5,
          row_time / scale,
          (middle_row + 0.5) * scale - 0.5};
}

Pinhole pinhole_of(const CameraModel& model) {
  return {model.fx, model.fy, model.cx, model.cy, model.row_time, 0.5 * (model.height - 1)};
}

Result<void> check(const CameraModel& model) {
  if (model.width < 64 || model.height < 48 || model.width > 4096 || model.height > 4096) {
    return Error{ErrorCode::invalid_argument, "camera size " + std::to_string(model.width) + " x " +
                                                  std::to_string(model.height) + " is not in 64 x 48 ... 4096 x 4096"};
  }
  if (!(model.fx > 1.0) || !(model.fy > 1.0) || !std::isfinite(model.fx) || !std::isfinite(model.fy)) {
    return Error{ErrorCode::invalid_argument, "camera focal length is missing or not a positive number of pixels"};
  }
  const bool centre_inside = model.cx > 0.0 && model.cy > 0.0 && model.cx < model.width && model.cy < model.height;
  if (!centre_inside) return Error{ErrorCode::invalid_argument, "camera principal point is outside the image"};
  if (!(std::abs(model.row_time) < 1e-3)) {
    return Error{ErrorCode::invalid_argument, "row_time is not a number of seconds below 1 ms"};
  }
  for (double coefficient : model.coefficients) {
    if (!std::isfinite(coefficient)) return Error{ErrorCode::invalid_argument, "distortion coefficient is not finite"};
  }
  return {};
}

Eigen::Vector2d distort(const CameraModel& model, const Eigen::Vector2d& normalised) {
  double x = normalised.x();
  double y = normalised.y();
  if (model.distortion != Distortion::none) {
    const auto& k = model.coefficients;
    const double r2 = x * x + y * y;
    double radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    if (model.distortion == Distortion::rational) radial /= 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    const double xd = x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x);
    y = y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y;
    x = xd;
  }
  return {model.fx * x + model.cx, model.fy * y + model.cy};
}

Rectifier::Rectifier(const CameraModel& model) : width_(model.width), height_(model.height) {
  const bool straight =
      model.distortion == Distortion::none ||
      std::all_of(model.coefficients.begin(), model.coefficients.end(), [](double k) { return k == 0.0; });
  if (straight) return;
  entries_.reserve(static_cast<std::size_t>(width_ * height_));
  covered_.reserve(entries_.capacity());
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const Eigen::Vector2d p = distort(model, {(x - model.cx) / model.fx, (y - model.cy) / model.fy});
      const bool inside =
          p.allFinite() && p.x() >= 0.0 && p.y() >= 0.0 && p.x() <= width_ - 1.0 && p.y() <= height_ - 1.0;
      const double px = p.allFinite() ? std::clamp(p.x(), 0.0, width_ - 1.001) : 0.0;
      const double py = p.allFinite() ? std::clamp(p.y(), 0.0, height_ - 1.001) : 0.0;
      const int ix = static_cast<int>(px);
      const int iy = static_cast<int>(py);
      entries_.push_back({iy * width_ + ix, static_cast<float>(px - ix), static_cast<float>(py - iy)});
      covered_.push_back(inside ? 1 : 0);
    }
  }
}

void Rectifier::apply(const float* source, float* target) const {
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    const float* p = source + entry.offset;
    const float top = p[0] + entry.fx * (p[1] - p[0]);
    const float bottom = p[width_] + entry.fx * (p[width_ + 1] - p[width_]);
    target[i] = top + entry.fy * (bottom - top);
  }
}

bool Rectifier::covered(int x, int y) const {
  return covered_.empty() || covered_[static_cast<std::size_t>(y * width_ + x)] != 0;
}

}  // namespace adit::thermal_odometry
