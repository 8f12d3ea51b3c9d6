// Frame to keyframe: pose and affine brightness of a new image against patches of known inverse depth, coarse to fine
// (paper R24, R27, R28; Engel et al., DSO, 2018, section 3.1, with the weights of Kerl et al., DVO, 2013).
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/geometry/se3.hpp"
#include "components/thermal_odometry/camera.hpp"
#include "components/thermal_odometry/pyramid.hpp"
#include "components/thermal_odometry/warp.hpp"

namespace adit::thermal_odometry {

// A keyframe the tracker aligns to; the image outlives the reference.
struct ReferenceView {
  CameraState state;
  const Pyramid* image = nullptr;
};

struct TrackResult {
  CameraState state;
  bool ok = false;
  float sigma = 0.0F;          // scale of the residuals [noise units]
  float visible_share = 0.0F;  // of the patches that were seen in the reference
  float inlier_share = 0.0F;   // of the visible ones: residual within 3 sigma
  float correlation = 0.0F;    // of the two images over the visible patches: near 0 where texture has gone
  float median_flow = 0.0F;    // px from the reference view
  int points = 0;
  // Information on the left increment of T_cw from the photometric residuals alone (affine brightness marginalised,
  // before any prior), not corrected for the correlation of neighbouring residuals.
  Matrix6d information = Matrix6d::Zero();
};

class Tracker {
 public:
  struct Config {
    float nu = 5.0F;               // degrees of freedom of the t-distribution
    float gradient_scale = 20.0F;  // c of the weight c^2 / (c^2 + |g|^2)
    float min_sigma = 0.3F;
    float max_sigma = 8.0F;
    double gain_sigma = 0.03;  // prior on a, from the newest reference
    int max_iterations = 8;
    int finest_level = 0;
    double stop_translation = 2e-4;  // m, or the unit of the map
    double stop_rotation = 1e-5;
    int min_points = 40;
    float min_visible_share = 0.15F;
    float min_inlier_share = 0.5F;
    float min_correlation = 0.4F;
  };
  Tracker(const Pinhole& camera, int levels, std::size_t capacity, const Config& config);

  // Takes the host intensities of every patch on every level. `newest`: the view flow is measured from and brightness
  // is tied to. Patches whose host has no image or that lie too near the border of a level are left out of that level.
  void set_reference(std::span<const ReferenceView> views, std::span<const Patch> patches, int newest);
  bool has_reference() const { return !patches_.empty(); }

  // Mean robust cost at one level, for choosing between starting points; infinite where too little is visible.
  double cost(const Pyramid& image, const CameraState& state, int level) const;

  struct PosePrior {
    Pose T_cw = Pose::Identity();
    Matrix6d information = Matrix6d::Zero();
  };
  // What the image's own rates follow from while it is aligned: its motion since another pose, and how that changed
  // before.
  struct Before {
    Pose T_cw = Pose::Identity();
    double dt = 0.0;                          // s
    Vector6d rate_change = Vector6d::Zero();  // from the middle of the interval to its end, as it was last time
    double spin_sigma = 0.0;  // rad/s, by which that may be wrong: the rows say the rest; 0: it is right
  };
  // From `start` at `top_level` down to the finest. The brightness offset of `start` is replaced by the median residual
  // at the top level, which alone absorbs the jump of a flat-field correction.
  TrackResult track(const Pyramid& image, const CameraState& start, int top_level, const PosePrior* prior,
                    const Before* before = nullptr) const;

 private:
  // [translation, rotation, a, b, spin]: the last is what a rolling readout turns by more than foreseen [rad/s].
  static constexpr int states = 11;
  using Matrix = Eigen::Matrix<double, states, states>;
  using Vector = Eigen::Matrix<double, states, 1>;
  struct System {
    Matrix H = Matrix::Zero();
    Vector g = Vector::Zero();
    double cost = 0.0;
    double scale = 0.0;
    int pixels = 0;
    int inliers = 0;
    int points = 0;
  };
  System linearise(const Pyramid& image, const CameraState& state, int level, float sigma, bool with_jacobian) const;
  double median_offset(const Pyramid& image, const CameraState& state, int level) const;
  float median_flow(const CameraState& state) const;
  float correlation(const Pyramid& image, const CameraState& state, int level) const;

  Pinhole camera_;
  int levels_;
  Config config_;
  std::vector<ReferenceView> views_;
  int newest_ = 0;
  std::vector<Patch> patches_;
  std::array<std::vector<PatchTemplate>, Pyramid::max_levels> templates_;
  std::array<int, Pyramid::max_levels> template_counts_{};
  mutable std::vector<float> scratch_;
};

}  // namespace adit::thermal_odometry
