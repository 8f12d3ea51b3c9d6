// From a patch of a host keyframe to pixels of a target image: the geometry and brightness all photometric code shares.
//
// Poses are T_cw (camera <- world); increments multiply from the left: T <- exp(xi) T, xi = [translation, rotation].
// Brightness of frame i: I_i - b_i = e^a_i L with the scene's radiance L, hence I_j = e^(a_j - a_i) (I_i - b_i) + b_j.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "components/geometry/se3.hpp"
#include "components/thermal_odometry/camera.hpp"
#include "components/thermal_odometry/pyramid.hpp"

namespace adit::thermal_odometry {

struct CameraState {
  Pose T_cw = Pose::Identity();      // at the middle row
  double a = 0.0;                    // log gain
  double b = 0.0;                    // noise units
  Vector6d rate = Vector6d::Zero();  // d/dt T_cw = rate T_cw, for the rows of a rolling readout [1/s]
};

// The pattern around a pixel of its host keyframe, on a plane in inverse depth.
struct Patch {
  float u = 0.0F;  // level 0
  float v = 0.0F;
  float inverse_depth = 0.0F;
  float slope_u = 0.0F;
  float slope_v = 0.0F;
  float sigma = 0.0F;  // of inverse_depth
  int host = 0;
};

inline float at_level(float pixel, int level) {
  return (pixel + 0.5F) / static_cast<float>(1 << level) - 0.5F;
}

// J = d(pixel)/d(left increment of the target pose) of a point seen at normalised (x, y) with inverse depth d there.
inline Eigen::Matrix<float, 2, 6> pixel_jacobian(float fx, float fy, float x, float y, float d) {
  Eigen::Matrix<float, 2, 6> J;
  J << fx * d, 0.0F, -fx * d * x, -fx * x * y, fx * (1.0F + x * x), -fx * y,  //
      0.0F, fy * d, -fy * d * y, -fy * (1.0F + y * y), fy * x * y, fy * x;
  return J;
}

// What carries the pixels of one host into one target at one level.
struct Warp {
  Eigen::Vector3f base;    // R K^-1 (0, 0, 1)
  Eigen::Vector3f step_u;  // R K^-1 (1, 0, 0)
  Eigen::Vector3f step_v;
  Eigen::Vector3f t;
  float fx;
  float fy;
  float cx;
  float cy;
  float gain;    // e^(a_j - a_i)
  float offset;  // b_j - gain b_i
  // A rolling readout sees each row at its own time: host and target are moved by their rates to that of the patch.
  bool rolling = false;
  float row_time;
  float middle_row;
  Eigen::Vector3f host_velocity;
  Eigen::Vector3f host_spin;
  Eigen::Vector3f velocity;
  Eigen::Vector3f spin;
  Eigen::Matrix3f R;

  Warp() = default;
  Warp(const CameraState& host, const CameraState& target, const Pinhole& camera)
      : fx(static_cast<float>(camera.fx)),
        fy(static_cast<float>(camera.fy)),
        cx(static_cast<float>(camera.cx)),
        cy(static_cast<float>(camera.cy)) {
    const Pose T = target.T_cw * host.T_cw.inverse();
    R = T.linear().cast<float>();
    t = T.translation().cast<float>();
    step_u = R.col(0) / fx;
    step_v = R.col(1) / fy;
    base = R.col(2) - step_u * cx - step_v * cy;
    const double ratio = std::exp(target.a - host.a);
    gain = static_cast<float>(ratio);
    offset = static_cast<float>(target.b - ratio * host.b);
    rolling = camera.row_time != 0.0;
    if (!rolling) return;
    row_time = static_cast<float>(camera.row_time);
    middle_row = static_cast<float>(camera.middle_row);
    host_velocity = host.rate.head<3>().cast<float>();
    host_spin = host.rate.tail<3>().cast<float>();
    velocity = target.rate.head<3>().cast<float>();
    spin = target.rate.tail<3>().cast<float>();
  }

  // The point, scaled by its inverse depth in the host.
  Eigen::Vector3f ray(float u, float v, float d) const {
    const Eigen::Vector3f X = base + u * step_u + v * step_v + d * t;
    return rolling ? at_its_row(X, u, v, d) : X;
  }
  // To first order in the time of a readout, in which nothing moves further than the texture is large.
  Eigen::Vector3f at_its_row(Eigen::Vector3f X, float u, float v, float d) const {
    const Eigen::Vector3f seen = R.transpose() * (base + u * step_u + v * step_v);  // (x, y, 1) in the host
    X -= row_time * (v - middle_row) * (R * (host_spin.cross(seen) + d * host_velocity));
    if (!(X.z() > 0.05F)) return X;
    const float row = fy * X.y() / X.z() + cy;
    return X + row_time * (row - middle_row) * (spin.cross(X) + d * velocity);
  }
  // Pixel of a point with z > 0.
  Eigen::Vector2f pixel(const Eigen::Vector3f& X) const { return {fx * X.x() / X.z() + cx, fy * X.y() / X.z() + cy}; }
};

// A patch seen in a target: where each pattern pixel falls, what is there, and the centre's geometry.
struct PatchView {
  Pattern value;
  Pattern gx;
  Pattern gy;
  float x;  // normalised coordinates of the centre in the target
  float y;
  float rho;  // host inverse depth times this is the target's
  // d(pixel)/d(inverse depth in the host)
  Eigen::Vector2f by_depth(const Warp& warp) const {
    return {warp.fx * rho * (warp.t.x() - warp.t.z() * x), warp.fy * rho * (warp.t.y() - warp.t.z() * y)};
  }
};

// False if any pattern pixel is behind the camera or too near the border. u, v, slopes: of this level.
inline bool view_patch(const Image& image, const Warp& warp, float u, float v, float d, float slope_u, float slope_v,
                       PatchView& out) {
  const Pattern dx = Eigen::Map<const Pattern>(pattern_x.data());
  const Pattern dy = Eigen::Map<const Pattern>(pattern_y.data());
  const Eigen::Vector3f centre = warp.ray(u, v, d);
  const Eigen::Vector3f along_u = warp.step_u + slope_u * warp.t;
  const Eigen::Vector3f along_v = warp.step_v + slope_v * warp.t;
  const Pattern z = centre.z() + dx * along_u.z() + dy * along_v.z();
  if (!(z.minCoeff() > 0.05F)) return false;
  const Pattern inverse = z.inverse();
  const Pattern px = warp.fx * (centre.x() + dx * along_u.x() + dy * along_v.x()) * inverse + warp.cx;
  const Pattern py = warp.fy * (centre.y() + dx * along_u.y() + dy * along_v.y()) * inverse + warp.cy;
  const float right = static_cast<float>(image.width) - 2.01F;
  const float bottom = static_cast<float>(image.height) - 2.01F;
  if (!(px.minCoeff() >= 1.0F && py.minCoeff() >= 1.0F && px.maxCoeff() < right && py.maxCoeff() < bottom))
    return false;
  for (int k = 0; k < pattern_size; ++k) {
    const Sample s = sample(image, px[k], py[k]);
    out.value[k] = s.value;
    out.gx[k] = s.gx;
    out.gy[k] = s.gy;
  }
  out.rho = 1.0F / centre.z();
  out.x = centre.x() * out.rho;
  out.y = centre.y() * out.rho;
  return true;
}

// Intensities of a patch in its own keyframe and the weight c^2 / (c^2 + |g|^2) that keeps strong edges from owning the
// estimate. False where the pattern does not fit.
struct PatchTemplate {
  Pattern intensity;
  Pattern weight;
};
inline bool take_template(const Image& image, float u, float v, float gradient_scale, PatchTemplate& out) {
  if (!samplable(image, u - 2.0F, v - 2.0F) || !samplable(image, u + 2.0F, v + 2.0F)) return false;
  const float c2 = gradient_scale * gradient_scale;
  for (int k = 0; k < pattern_size; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Sample s = sample(image, u + pattern_x[i], v + pattern_y[i]);
    out.intensity[k] = s.value;
    out.weight[k] = c2 / (c2 + s.gx * s.gx + s.gy * s.gy);
  }
  return true;
}

}  // namespace adit::thermal_odometry
