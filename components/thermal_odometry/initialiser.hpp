// Monocular start: relative pose, brightness and all inverse depths of two views together, coarse to fine, with depths
// that lean on their neighbours (paper R26; Engel et al., DSO, 2018, as the published code does it, with one set of
// points for all levels). Scale is arbitrary: the median inverse depth is 1.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "components/thermal_odometry/selection.hpp"
#include "components/thermal_odometry/warp.hpp"

namespace adit::thermal_odometry {

class Initialiser {
 public:
  struct Config {
    float gradient_scale = 20.0F;
    float min_sigma = 0.5F;
    float max_sigma = 8.0F;
    double coupling = 3.0;       // of a depth to its neighbours' median
    double spin_sigma = 0.3;     // rad/s, of the turn during a rolling readout about the mean since the last frame
    float min_parallax = 0.02F;  // of the image width, median translational flow
    float max_flow = 0.25F;      // of the image width: start over from a newer first view
    int min_frames = 4;
    // Measured: 0.70 to 0.74 where a forecourt gave a false map, 0.78 to 0.93 in tunnels.
    float min_inlier_share = 0.75F;
    float max_relative_sigma = 0.15F;  // of a depth that is handed out
  };
  static constexpr int neighbours = 8;

  Initialiser(const Pinhole& camera, int width, int levels, std::size_t capacity, const Config& config);

  // Swaps `image` in as the first view. Too few pixels (< 2 neighbours + 1): stays inactive.
  void start(std::int64_t stamp_ns, Pyramid& image, std::span<const Pixel> pixels);
  bool active() const { return active_; }
  void stop() { active_ = false; }

  enum class Outcome { waiting, done, lost };
  // Aligns one more frame, later than the last one, to the first view. `done`: parallax, residuals and depths are good
  // enough to build a map, and no other direction of travel explains the pixels better.
  Outcome add(std::int64_t stamp_ns, const Pyramid& image);

  std::int64_t stamp_ns() const { return stamp_ns_; }
  Pyramid& first_image() { return first_; }
  const CameraState& state() const { return state_; }  // of the last frame; the first view is the identity
  float parallax() const { return parallax_; }         // px, median, of the last frame
  float sigma() const { return sigma_; }
  float inlier_share() const { return inlier_share_; }
  // Points with a trusted depth, host 0. Valid until the next call.
  std::span<const Patch> patches();

 private:
  struct Point {
    float u;
    float v;
    float d = 1.0F;
    float anchor = 1.0F;  // what the neighbours say
    float hessian = 0.0F;
    float energy = 0.0F;
    bool good = false;
    std::array<int, neighbours> near{};
  };
  // [translation, rotation, a, b, spin]: the last is what a rolling readout turns beyond the mean rate [rad/s].
  static constexpr int states = 11;
  using Matrix = Eigen::Matrix<double, states, states>;
  using Vector = Eigen::Matrix<double, states, 1>;
  struct System {
    Matrix H;
    Vector g;
    double energy = 0.0;
    double scale = 0.0;
    int residuals = 0;
    int inliers = 0;
  };
  System linearise(const Pyramid& image, const CameraState& state, int level, double damping);
  void update_rate();
  void refine(const Pyramid& image, int level, int iterations);
  void refine_from_the_top(const Pyramid& image);
  void lean_on_neighbours();
  void find_neighbours();
  void measure(const Pyramid& image);
  struct Solution {
    CameraState state;
    Eigen::Vector3d spin;
    std::vector<float> depths;
    std::vector<float> anchors;
    double energy = 0.0;
  };
  void store(const Pyramid& image, Solution& out);
  bool beaten_by_a_rival(const Pyramid& image);

  Pinhole camera_;
  int width_;
  int levels_;
  Config config_;
  bool active_ = false;
  int frames_ = 0;
  std::int64_t stamp_ns_ = 0;
  Pyramid first_;
  CameraState state_;
  Eigen::Vector3d spin_ = Eigen::Vector3d::Zero();
  Pose before_ = Pose::Identity();  // T_cw of the frame before
  double dt_ = 0.0;                 // s since then
  std::int64_t last_ns_ = 0;
  Vector6d velocity_ = Vector6d::Zero();  // left twist of T_cw [1/s]
  float sigma_ = 2.0F;
  float parallax_ = 0.0F;
  float inlier_share_ = 0.0F;
  float visible_share_ = 0.0F;
  std::vector<Point> points_;
  std::vector<float> backup_;
  Solution best_;
  Solution rival_;
  std::array<std::vector<PatchTemplate>, Pyramid::max_levels> looks_;
  struct Elimination {
    float H = 0.0F;
    float g = 0.0F;
    Eigen::Matrix<float, states, 1> c = Eigen::Matrix<float, states, 1>::Zero();
  };
  std::vector<Elimination> eliminations_;
  std::vector<Patch> patches_;
  std::vector<float> scratch_;
};

}  // namespace adit::thermal_odometry
