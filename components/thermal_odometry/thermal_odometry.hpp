// Direct sparse odometry on 16-bit thermal images with LiDAR-anchored depth. One call a frame, one thread, no clock, no
// allocation after the first keyframes, the same output for the same input bit by bit.
//
// Paper: "Thermal-LiDAR fusion for robust tunnel localization", R22-R34; methods: Engel, Koltun, Cremers, "Direct
// sparse odometry" (PAMI 2018); Gao et al., LDSO (IROS 2018); Shin and Kim, "Sparse depth enhanced direct
// thermal-infrared SLAM beyond the visible spectrum" (RA-L 2019).
#pragma once

#include <memory>
#include <span>

#include "components/thermal_odometry/estimate.hpp"
#include "components/thermal_odometry/frame.hpp"
#include "components/thermal_odometry/frame_aligner.hpp"
#include "components/thermal_odometry/front_end.hpp"
#include "components/thermal_odometry/initialiser.hpp"
#include "components/thermal_odometry/mapper.hpp"
#include "components/thermal_odometry/tracker.hpp"
#include "idl/result.hpp"

namespace adit::thermal_odometry {

enum class Mode : std::uint8_t {
  anchored,  // metric by LiDAR depth; monocular with carried scale while there is none
  mono,      // the paper's: depth from motion, scale arbitrary
};

struct Config {
  Mode mode = Mode::anchored;
  FrameGate::Config gate;
  FrontEnd::Config front_end;
  Tracker::Config tracker;
  FrameAligner::Config aligner;
  Mapper::Config mapper;
  Initialiser::Config initialiser;
  // When a frame becomes a keyframe: old enough, and flow, visibility or age say so. Few with LiDAR depth (every
  // hand-over costs accuracy), more without (depth needs short baselines to match and long ones to be exact).
  double anchored_keyframe_age_s = 0.3;
  double mono_keyframe_age_s = 0.12;
  double max_keyframe_age_s = 1.0;
  double anchored_keyframe_flow = 0.125;  // of the image width, median
  double mono_keyframe_flow = 0.05;
  double anchored_visible_share = 0.35;
  double mono_visible_share = 0.6;
  double young_keyframe_age_s = 0.1;  // at least, when less than two thirds of the visible share are left
  int restart_after = 5;              // frames that could not be aligned
  double usual_depth = 1.0;           // median depth a monocular map starts with: its unit of length
  // Of residuals (neighbouring pixels, the bilateral filter, the interpolation): covariance = correlation * inverse
  // photometric information. Measured on simulated drives (folder_study): with 10 a single step has a NEES of 1 in
  // every direction, but steps over 0.2 s one of 0.4, since errors against one keyframe do not add up; this lies
  // between.
  double correlation = 6.0;
};

// For pictures: a point of the map seen from the last measured pose (paper R32).
struct MapPoint {
  float u;  // px, rectified image
  float v;
  float depth;  // m or map units
  bool anchored;
};

class ThermalOdometry {
 public:
  static Result<std::unique_ptr<ThermalOdometry>> create(const CameraModel& camera, const Config& config);
  ~ThermalOdometry();
  ThermalOdometry(const ThermalOdometry&) = delete;
  ThermalOdometry& operator=(const ThermalOdometry&) = delete;

  // Never throws, never NaN. A frame that is not good is counted and changes no pose. `depth`: a cloud that arrived
  // since the last frame, not newer than this one. The reference is valid until the next call.
  const Estimate& process(const Frame& frame, const Prior* prior = nullptr, const DepthPoints* depth = nullptr);
  const Estimate& estimate() const;
  // Forgets the map and the pose, keeps memory and counters.
  void reset();
  // Writes up to out.size() points, returns how many.
  std::size_t map_points(std::span<MapPoint> out) const;

 private:
  class Engine;
  explicit ThermalOdometry(std::unique_ptr<Engine> engine);
  std::unique_ptr<Engine> engine_;
};

}  // namespace adit::thermal_odometry
