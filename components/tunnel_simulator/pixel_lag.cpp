#include "components/tunnel_simulator/pixel_lag.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "components/tunnel_simulator/pose_samples.hpp"

namespace adit::tunnel_simulator {
namespace {

// Ages the motion is looked at [time constants]: 2 -+ sqrt(2), the nodes of Gauss and Laguerre, with which the mean
// displacement is that of a motion of third order.
constexpr double kYoung = 0.5857864376, kOld = 3.4142135624;
constexpr double kKnot = 2e-3;    // of the pose's interpolation [s]
constexpr float kNothing = 1e4F;  // range of the sky [m]

// Ages of the samples of an exponential trail [time constants] and their squares: the means of `taps` equally likely
// parts, so that the trail's own moments are right for any number of them.
constexpr int kMostTaps = 10;
struct Trail {
  using Table = std::array<std::array<float, kMostTaps>, kMostTaps + 1>;
  Table ages{}, squares{};
  Trail() {
    for (std::size_t taps = 1; taps <= kMostTaps; ++taps) {
      const auto n = static_cast<double>(taps);
      // Integrals of s exp(-s) and s^2 exp(-s) from the age on that a share k / n of the trail is younger than.
      double age_left = 1.0, square_left = 2.0;
      for (std::size_t k = 0; k < taps; ++k) {
        const double older = 1.0 - static_cast<double>(k + 1) / n;
        const double s = -std::log(std::max(older, 1e-300));
        const double ages_beyond = older * (s + 1.0), squares_beyond = older * (s * s + 2.0 * s + 2.0);
        ages[taps][k] = static_cast<float>(n * (age_left - ages_beyond));
        squares[taps][k] = static_cast<float>(n * (square_left - squares_beyond));
        age_left = ages_beyond, square_left = squares_beyond;
      }
    }
  }
};
const Trail kTrail;

// d(normalised pixel)/dt of what is seen at (x, y) with inverse depth `near`, for a camera that moves like this.
struct Flow {
  explicit Flow(const Vector6d& rate) : v(rate.head<3>().cast<float>()), w(rate.tail<3>().cast<float>()) {}
  Eigen::Vector3f v, w;
  // Returns how fast it recedes, over its depth.
  float at(float x, float y, float near, float& along_x, float& along_y) const {
    const float ax = -v.x() * near - (w.y() - w.z() * y);
    const float ay = -v.y() * near - (w.z() * x - w.x());
    const float az = -v.z() * near - (w.x() * y - w.y() * x);
    along_x = ax - x * az;
    along_y = ay - y * az;
    return az;
  }
};

}  // namespace

PixelLag::PixelLag(const CameraModel& camera, double time_constant, double row_time)
    : camera_(camera), time_constant_(time_constant), row_time_(row_time) {
  for (std::vector<Pose>* poses : {&now_, &young_, &old_}) poses->resize(static_cast<std::size_t>(camera.height));
}

void PixelLag::begin(const std::function<Pose(double)>& pose, double time) {
  sample_poses(pose, time, row_time_, kKnot, now_);
  sample_poses(pose, time - kYoung * time_constant_, row_time_, kKnot, young_);
  sample_poses(pose, time - kOld * time_constant_, row_time_, kKnot, old_);
}

// The trail is bent as the motion changes: the mean rate over an age grows linearly with the age, through those over a
// young and an old one.
void PixelLag::apply(int row, const Rays& rays, std::span<const float> range, std::span<const float> image,
                     std::span<float> out) const {
  const int width = camera_.width;
  const auto r = static_cast<std::size_t>(row);
  const Vector6d young = se3_log(young_[r].inverse() * now_[r]) / (kYoung * time_constant_);
  const Vector6d old = se3_log(old_[r].inverse() * now_[r]) / (kOld * time_constant_);
  const Vector6d change = (old - young) / (kOld - kYoung);
  const Flow straight(young - kYoung * change), bent(change);
  const auto scale_x = static_cast<float>(time_constant_ * camera_.fx);
  const auto scale_y = static_cast<float>(time_constant_ * camera_.fy);
  const auto last_x = static_cast<float>(width) - 1.001F;
  const auto last_y = static_cast<float>(camera_.height) - 1.001F;
  constexpr std::size_t kBlock = 64;
  // Of the first time constant: the trail's straight part and its bend [px], and how far the point came [of its depth].
  std::array<float, kBlock> trail_x, trail_y, bend_x, bend_y, away;
  const std::size_t row_begin = r * static_cast<std::size_t>(width);
  for (int begin = 0; begin < width; begin += static_cast<int>(kBlock)) {
    const auto count = static_cast<std::size_t>(std::min(static_cast<int>(kBlock), width - begin));
    const std::size_t first = row_begin + static_cast<std::size_t>(begin);
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = first + k;
      const float near = 1.0F / (rays.z[i] * (range[i] > 0.0F ? range[i] : kNothing));
      away[k] = static_cast<float>(time_constant_) *
                straight.at(rays.plane_x[i], rays.plane_y[i], near, trail_x[k], trail_y[k]);
      bent.at(rays.plane_x[i], rays.plane_y[i], near, bend_x[k], bend_y[k]);
      trail_x[k] *= scale_x, trail_y[k] *= scale_y;
      bend_x[k] *= scale_x, bend_y[k] *= scale_y;
    }
    for (std::size_t k = 0; k < count; ++k) {
      const float length = std::hypot(trail_x[k] + bend_x[k], trail_y[k] + bend_y[k]);
      const int taps =
          length < 0.1F ? 1 : std::clamp(static_cast<int>(1.5F * std::min(60.0F, length)) + 1, 2, kMostTaps);
      float sum = 0.0F;
      for (int n = 0; n < taps; ++n) {
        const float age = kTrail.ages[static_cast<std::size_t>(taps)][static_cast<std::size_t>(n)];
        const float square = kTrail.squares[static_cast<std::size_t>(taps)][static_cast<std::size_t>(n)];
        const float nearer = 1.0F / std::max(0.1F, 1.0F + age * away[k]);
        const float behind_x = nearer * (age * trail_x[k] + square * bend_x[k]);
        const float behind_y = nearer * (age * trail_y[k] + square * bend_y[k]);
        const float px = std::clamp(static_cast<float>(begin + static_cast<int>(k)) + behind_x, 0.0F, last_x);
        const float py = std::clamp(static_cast<float>(row) + behind_y, 0.0F, last_y);
        const int ix = static_cast<int>(px);
        const int iy = static_cast<int>(py);
        const float fx = px - static_cast<float>(ix);
        const float fy = py - static_cast<float>(iy);
        const float* a = image.data() + iy * width + ix;
        const float top = a[0] + fx * (a[1] - a[0]);
        const float bottom = a[width] + fx * (a[width + 1] - a[width]);
        sum += top + fy * (bottom - top);
      }
      out[first + k] = sum / static_cast<float>(taps);
    }
  }
}

}  // namespace adit::tunnel_simulator
