// The map: a window of keyframes and their points. What happens at a keyframe: choose pixels, give them depth from
// LiDAR or from older keyframes, adjust the window, let old keyframes go.
#pragma once

#include <span>
#include <vector>

#include "components/thermal_odometry/cloud_buffer.hpp"
#include "components/thermal_odometry/depth_anchor.hpp"
#include "components/thermal_odometry/epipolar.hpp"
#include "components/thermal_odometry/selection.hpp"
#include "components/thermal_odometry/tracker.hpp"
#include "components/thermal_odometry/window.hpp"

namespace adit::thermal_odometry {

class Mapper {
 public:
  struct Config {
    PixelSelector::Config selection;
    DepthAnchor::Config anchor;
    EpipolarConfig epipolar;
    Window::Config window;
    int anchored_keyframes = 4;  // in the window
    int mono_keyframes = 6;      // at most max_keyframes - 1
    int anchored_views = 2;      // newest keyframes a frame is aligned to jointly; monocular: all
    // Grid cells with a strong gradient, to begin a map. Measured: 0 at TT0, 6 in a real picture of a flat scene, 50
    // for a low camera at TT2 (its lower half is a road without texture), 61 at a driver's height.
    int min_texture = 30;
    int min_points = 150;          // with LiDAR depth, for a keyframe that counts as anchored
    bool optimise = true;          // off, anchored mode: frame to keyframe alone
    float lidar_looseness = 1.0F;  // of the depth prior's sigma
    std::size_t max_cloud_points = 1U << 17U;
    double max_cloud_age_s = 0.2;  // from the last point of the sweep
  };
  Mapper(const CameraModel& camera, int levels, const Config& config);

  void add_cloud(const DepthPoints& cloud) { clouds_.add(cloud); }
  void clear();
  bool empty() const { return window_.count() == 0; }
  const Window& window() const { return window_; }
  const Keyframe& newest() const { return window_.keyframe(window_.newest()); }

  struct Report {
    bool made = false;
    bool textured = true;
    bool failed = false;  // the window broke: give the map up
    int selected = 0;
    int anchored = 0;
    int matched = 0;  // depths from older keyframes
    bool metric = false;
    double log_scale_correction = 0.0;  // applied to the whole window about this keyframe
    float sigma = 0.0F;
  };
  bool textured() const { return selector_.strong_cells() >= config_.min_texture; }  // of the image last selected from
  // Pixels to begin a map from by motion alone.
  std::span<const Pixel> select(const Pyramid& image, const Rectifier& rectifier) {
    selector_.select(image, rectifier);
    return selector_.clear_ones();
  }

  // Makes the image a keyframe and swaps it away. With `lidar` off clouds are ignored (mode mono). `scaled`: the map is
  // metric or was, so that LiDAR coming back is taken as a correction of scale. Without a map only enough LiDAR depth
  // makes one.
  Report add_keyframe(std::int64_t stamp_ns, const CameraState& state, Pyramid& image, const Rectifier& rectifier,
                      const PoseHistory& history, bool lidar, float sigma);
  // A monocular map from two views: the first hosts the points.
  Report start(std::int64_t first_stamp_ns, const CameraState& first, Pyramid& first_image,
               std::span<const Patch> points, std::int64_t stamp_ns, const CameraState& state, Pyramid& image,
               const Rectifier& rectifier, float sigma);

  // Hands the points a frame should be aligned to to the tracker.
  void set_reference(Tracker& tracker);
  float median_inverse_depth() const;

 private:
  int add_anchored(std::span<const Pixel> pixels, int slot);
  int add_matched(std::span<const Pixel> pixels, int slot, bool fill_all, float sigma);
  void survey(int slot);
  double scale_offset(int slot, int* used);
  void trim(int keep);

  Pinhole camera_;
  int width_;
  int height_;
  Config config_;
  PixelSelector selector_;
  DepthAnchor anchor_;
  CloudBuffer clouds_;
  Window window_;
  bool anchored_map_ = false;  // newest keyframe anchored
  // What the points of the window look like in the newest keyframe, by cells: for the range of new depths.
  struct Cell {
    float low = 0.0F;  // inverse depth; low > high: nothing there
    float high = -1.0F;
  };
  static constexpr int cell_size = 20;
  int columns_;
  int rows_;
  std::vector<Cell> cells_;
  float lowest_ = 0.0F;
  float highest_ = 0.0F;
  std::vector<std::uint8_t> occupied_;
  std::vector<Patch> patches_;
  mutable std::vector<float> scratch_;
};

}  // namespace adit::thermal_odometry
