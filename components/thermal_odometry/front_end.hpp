// From raw counts to an image in noise units: what may enter (FrameGate) and what is done to it (FrontEnd).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "components/geometry/stamp_order.hpp"
#include "components/thermal_odometry/camera.hpp"
#include "components/thermal_odometry/frame.hpp"
#include "components/thermal_odometry/pyramid.hpp"

namespace adit::thermal_odometry {

enum class Verdict : std::uint8_t {
  good,
  wrong_size,  // not the calibrated size, or no data
  bad_stamp,   // not newer than the last frame
  ffc,         // the shutter is closed by the camera's own word
  frozen,      // the last picture again: shutter closed, or a stuck driver
  uniform,     // one value everywhere: black, lens cap
  saturated,   // more than half of the pixels at the limit
  eight_bit,   // an 8-bit picture in 16-bit clothes: contrast is already lost
};
inline constexpr int verdict_count = 8;

// Looks at every 16th pixel of every 16th row; costs microseconds. Two frames of an uncooled detector never agree: a
// mean difference below a tenth of the noise is a repeated frame (Stone et al. 2026 and our own runs: the only
// reliable sign of a silent flat-field correction).
class FrameGate {
 public:
  struct Config {
    float frozen_fraction = 0.1F;  // of the temporal noise
    int clock_run = 5;             // frames refused for their stamps, each newer than the one before
    double clock_step_s = 1.0;     // that the clock goes back by at least: less is a transport that is not in order
  };
  FrameGate(const CameraModel& model, const Config& config);
  // `noise` in counts. A frame that is not good changes nothing but the remembered stamp and picture.
  Verdict check(const Frame& frame, float noise);
  // The last frame was taken although it is older than the one before: clock_run frames in a row agreed with each other
  // that the clock has been set back by clock_step_s (or that one frame came from the future).
  bool clock_set_back() const { return clock_set_back_; }

 private:
  int width_;
  int height_;
  Config config_;
  StampOrder order_;
  std::optional<std::int64_t> last_stamp_ns_;
  bool clock_set_back_ = false;
  std::vector<std::uint16_t> last_;
  std::vector<std::uint16_t> current_;
};

// Spatial estimate of the temporal noise [counts]: median absolute mixed second difference, which texture hardly
// touches (after Immerkaer 1996). At least the quantisation noise.
float estimate_noise(const Frame& frame, std::vector<float>& scratch);

class FrontEnd {
 public:
  struct Config {
    float noise_counts = 0.0F;  // temporal noise; 0: estimated on the first good frame
    bool destripe = true;
    float destripe_limit = 1.0F;  // noise units, of one column
    float destripe_rate = 0.05F;
    bool bilateral = true;
    float bilateral_range = 3.0F;  // noise units, as the sigma of a Gaussian range kernel
    float bilateral_space = 1.4F;  // px
  };
  FrontEnd(const CameraModel& model, const Config& config);

  // Median and noise of this frame become the unit and the zero. While there is no map: a first frame of garbage must
  // not be the unit of all that follow.
  void calibrate(const Frame& frame);
  float noise() const { return noise_; }  // counts
  const Rectifier& rectifier() const { return rectifier_; }
  // `frame` has passed the gate; `out` is allocated for the calibrated size.
  void process(const Frame& frame, Pyramid& out);

 private:
  void update_columns();
  void smooth(const Image& in, Image& out) const;

  Config config_;
  Rectifier rectifier_;
  bool calibrated_ = false;
  float zero_ = 0.0F;
  float noise_ = 1.0F;
  Image counts_;    // noise units, before filter and rectification
  Image smoothed_;  // before rectification
  std::vector<float> columns_;
  std::vector<float> profile_;
  std::vector<float> scratch_;
  std::vector<float> samples_;
  std::array<float, 25> space_weights_{};
};

}  // namespace adit::thermal_odometry
