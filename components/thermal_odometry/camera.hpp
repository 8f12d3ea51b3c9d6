// Calibration: from the distorted image the camera delivers to the ideal pinhole image the odometry works in.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "components/thermal_odometry/frame.hpp"
#include "idl/result.hpp"

namespace adit::thermal_odometry {

struct Pinhole {
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  double row_time = 0.0;  // s from row to row, counted from middle_row
  double middle_row = 0.0;
  // Intrinsics `level` halvings down; the half-pixel shift belongs to pixel centres at integers.
  Pinhole at_level(int level) const;
};

Pinhole pinhole_of(const CameraModel& model);

// Says what is wrong with a calibration: size, focal lengths, non-finite values.
Result<void> check(const CameraModel& model);

// Normalised ideal coordinates (x/z, y/z) to the pixel at which the camera sees them.
Eigen::Vector2d distort(const CameraModel& model, const Eigen::Vector2d& normalised);

// A table of bilinear look-ups that turns the delivered image into the pinhole image of the same size and intrinsics.
class Rectifier {
 public:
  explicit Rectifier(const CameraModel& model);
  bool identity() const { return entries_.empty(); }
  // Both images are width x height, row-major, without padding. Pixels without a source repeat the border.
  void apply(const float* source, float* target) const;
  // False where the pinhole pixel lies outside the delivered image.
  bool covered(int x, int y) const;

 private:
  struct Entry {
    std::int32_t offset;
    float fx;
    float fy;
  };
  int width_ = 0;
  int height_ = 0;
  std::vector<Entry> entries_;
  std::vector<std::uint8_t> covered_;
};

}  // namespace adit::thermal_odometry
