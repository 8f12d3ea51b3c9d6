// Windowed photometric bundle adjustment: poses and brightness of a few keyframes and one inverse depth a point, with
// marginalisation and first-estimate Jacobians (Engel et al., DSO, 2018, sections 2.2-2.3; Leutenegger et al. 2015 for
// the prior; Huang et al. 2009 for first estimates). LiDAR depth enters as a prior on a point (Shin and Kim 2019).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/thermal_odometry/warp.hpp"

namespace adit::thermal_odometry {

inline constexpr int max_keyframes = 7;
inline constexpr int state_size = 8;  // pose increment, a, b
inline constexpr int boresight_size = 3;

struct Keyframe {
  bool used = false;
  bool in_prior = false;  // its linearisation point is frozen
  std::int64_t id = 0;
  std::int64_t stamp_ns = 0;
  CameraState first;  // linearisation point
  Eigen::Matrix<double, state_size, 1> delta = Eigen::Matrix<double, state_size, 1>::Zero();
  CameraState state;  // exp(delta) first
  Pyramid image;
  int hosted = 0;  // points it was given
};

enum class Sight : std::uint8_t { untried, in, outlier, outside };

struct WindowPoint {
  Patch patch;  // host: slot of the keyframe
  PatchTemplate look;
  float prior_depth = 0.0F;                                // LiDAR's, as it would be with the extrinsics as given
  float prior_information = 0.0F;                          // 0: no LiDAR
  Eigen::Vector3f by_boresight = Eigen::Vector3f::Zero();  // d(LiDAR's inverse depth)/d(boresight) [1/m a rad]
  float hessian = 0.0F;  // information on the inverse depth from the pixels, of the last linearisation
  std::array<Sight, max_keyframes> sight{};
  int good = 0;  // targets it is seen in as an inlier
  bool anchored() const { return prior_information > 0.0F; }
};

class Window {
 public:
  static constexpr int boresight_at = max_keyframes * state_size;
  static constexpr int dimension = boresight_at + boresight_size;
  using Matrix = Eigen::Matrix<double, dimension, dimension>;
  using Vector = Eigen::Matrix<double, dimension, 1>;

  struct Config {
    int iterations = 4;
    float nu = 5.0F;
    float gradient_scale = 20.0F;
    float min_sigma = 0.3F;
    float max_sigma = 8.0F;
    float outlier = 16.0F;    // mean squared normalised residual of a patch
    double gain_sigma = 0.3;  // weak: a and b stay bounded
    double offset_sigma = 100.0;
    double correlation = 10.0;  // photometric information counts this much too often
    // Of points that enter the prior. DSO takes 0.25; with few keyframes and LiDAR depth that lets the window turn
    // against its past (measured: twice the rotation drift). Without LiDAR depth 1 keeps the scale's errors for good.
    float anchored_marginal_weight = 1.0F;
    float marginal_weight = 0.25F;
    // Rotation of the LiDAR's points about the camera that its extrinsics lack: standard deviation as given [rad a
    // axis] (0.3 degrees), and its random walk from keyframe to keyframe, which keeps it adaptive.
    double boresight_sigma = 0.005;
    double boresight_walk = 5e-5;
    float min_hessian = 8.0F;  // times 1/d^2: relative depth information a marginalised point needs
  };
  Window(const Pinhole& camera, std::size_t capacity, const Config& config);

  void clear();
  // A free slot for the next keyframe, or -1: marginalise first.
  int free_slot() const;
  int newest() const { return newest_; }
  int oldest() const;  // -1: none
  int count() const;
  Keyframe& keyframe(int slot) { return keyframes_[static_cast<std::size_t>(slot)]; }
  const Keyframe& keyframe(int slot) const { return keyframes_[static_cast<std::size_t>(slot)]; }
  std::span<WindowPoint> points() { return points_; }
  std::span<const WindowPoint> points() const { return points_; }

  // Swaps `image` into a free slot.
  int add_keyframe(std::int64_t stamp_ns, const CameraState& state, Pyramid& image);
  // False if the window is full or the pattern leaves the host image. `by_boresight`: of a LiDAR depth (the patch's)
  // that was projected with the present boresight().
  bool add_point(const Patch& patch, float prior_information,
                 const Eigen::Vector3f& by_boresight = Eigen::Vector3f::Zero());

  struct Stats {
    float sigma = 0.0F;
    int residuals = 0;
    int points = 0;
    bool ok = true;  // false: a step was not finite; the window must be given up
  };
  // Residuals and prior know relative poses alone; the oldest keyframe holds the window in place. (As part of the prior
  // an absolute pose does not stay consistent: first estimates of old keyframes do not follow a shift of the whole
  // window, those of new ones do, and the shift feeds itself.)
  Stats optimise(int iterations);

  // Moves points that no longer help and then the whole keyframe into the prior.
  void marginalise(int slot);
  // The keyframe to give up, never one of the two newest: one with hardly any points left, else by DSO's distance
  // score (which would keep the former for ever: what is far from all others crowds nobody).
  int least_useful() const;
  // Points whose host stays but which neither of the two newest keyframes sees: into the prior.
  void retire_points();
  // Rotation vector in camera axes to turn the LiDAR's points in the camera frame by [rad]. Estimated with everything
  // else from how the depths the pixels agree on differ from the LiDAR's; survives clear(), as its covariance does.
  const Eigen::Vector3d& boresight() const { return boresight_; }
  const Eigen::Matrix3d& boresight_covariance() const { return boresight_covariance_; }

  // Everything `factor` times as large, about the newest keyframe's centre.
  void rescale(double factor);

  // The normal equations of the points for which `use` is set, all points if it is empty, around the current state with
  // first-estimate geometry; depths eliminated. For tests and for marginalisation.
  struct Normal {
    Matrix H = Matrix::Zero();
    Vector g = Vector::Zero();
    double energy = 0.0;
    double scale = 0.0;
    int residuals = 0;
  };
  const Normal& linearise(bool only_marked, double depth_damping);
  // What the last linearise() holds of one depth: H = 0 if nothing constrains it.
  struct DepthBlock {
    float H;
    float g;
    const Eigen::Matrix<float, dimension, 1>& coupling;
  };
  DepthBlock depth_block(std::size_t point) const { return {systems_[point].H, systems_[point].g, couplings_[point]}; }
  const Matrix& prior_H() const { return prior_H_; }
  const Vector& prior_g() const { return prior_g_; }
  // State vector: the deltas of all slots, the boresight.
  Vector delta() const;
  void apply(const Vector& step);
  float sigma() const { return sigma_; }

 private:
  struct PointSystem {
    float H = 0.0F;
    float g = 0.0F;
    bool marked = false;
  };
  void update_state(Keyframe& keyframe);
  void begin_prior();
  void loosen_boresight();
  void remove_marked();
  void eliminate(int slot);

  Pinhole camera_;
  Config config_;
  std::array<Keyframe, max_keyframes> keyframes_;
  int newest_ = -1;
  std::int64_t next_id_ = 0;
  std::vector<WindowPoint> points_;
  std::vector<PointSystem> systems_;
  std::vector<Eigen::Matrix<float, dimension, 1>> couplings_;
  Matrix prior_H_ = Matrix::Zero();
  Vector prior_g_ = Vector::Zero();
  Eigen::Vector3d boresight_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d boresight_covariance_;
  Normal normal_;
  float sigma_ = 1.5F;
};

// Schur complement: removes rows and columns [at, at + state_size) of H x = -g and leaves them zero.
void eliminate_block(Window::Matrix& H, Window::Vector& g, int at);

}  // namespace adit::thermal_odometry
