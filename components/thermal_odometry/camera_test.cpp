#include "components/thermal_odometry/camera.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace adit::thermal_odometry {
namespace {

CameraModel optris() {
  return {382,
          288,
          375.36,
          375.36,
          201.60,
          148.68,
          Distortion::plumb_bob,
          {-0.45115, 0.32741, -0.0019030, 3.1386e-05, -0.081075}};
}

TEST(Camera, LevelsKeepTheRay) {
  const Pinhole camera{417.0, 411.0, 319.5, 255.5};
  // The centre of a 2 x 2 block at pixels (2i, 2i+1) is at 2i + 0.5; on the next level it is pixel i.
  for (int i : {0, 7, 100}) {
    const double fine = (2 * i + 0.5 - camera.cx) / camera.fx;
    const double coarse = (i - camera.at_level(1).cx) / camera.at_level(1).fx;
    EXPECT_NEAR(fine, coarse, 1e-12);
  }
}

TEST(Camera, DistortionMatchesItsPolynomial) {
  const CameraModel model = optris();
  const Eigen::Vector2d p = distort(model, {0.3, -0.2});
  const double r2 = 0.13;
  const double radial = 1 - 0.45115 * r2 + 0.32741 * r2 * r2 - 0.081075 * r2 * r2 * r2;
  const double x = 0.3 * radial + 2 * -0.0019030 * 0.3 * -0.2 + 3.1386e-05 * (r2 + 2 * 0.09);
  EXPECT_NEAR(p.x(), 375.36 * x + 201.60, 1e-9);
  CameraModel rational = model;
  rational.distortion = Distortion::rational;
  rational.coefficients[5] = 0.5;
  const double halved = radial / (1 + 0.5 * r2);
  const double xr = 0.3 * halved + 2 * -0.0019030 * 0.3 * -0.2 + 3.1386e-05 * (r2 + 2 * 0.09);
  EXPECT_NEAR(distort(rational, {0.3, -0.2}).x(), 375.36 * xr + 201.60, 1e-9);
}

TEST(Camera, RectifierPutsTheDistortedPixelAtItsPinholePlace) {
  const CameraModel model = optris();
  const Rectifier rectifier(model);
  ASSERT_FALSE(rectifier.identity());
  const auto n = static_cast<std::size_t>(model.width * model.height);
  std::vector<float> source(n);
  std::vector<float> target(n);
  for (int y = 0; y < model.height; ++y) {
    for (int x = 0; x < model.width; ++x)
      source[static_cast<std::size_t>(y * model.width + x)] = static_cast<float>(3 * x - 2 * y);
  }
  rectifier.apply(source.data(), target.data());
  for (const auto& [x, y] : {std::pair{200, 150}, {20, 30}, {350, 270}}) {
    const Eigen::Vector2d p = distort(model, {(x - model.cx) / model.fx, (y - model.cy) / model.fy});
    EXPECT_TRUE(rectifier.covered(x, y));
    EXPECT_NEAR(target[static_cast<std::size_t>(y * model.width + x)], 3 * p.x() - 2 * p.y(), 1e-2);
  }
}

TEST(Camera, WrongCalibrationIsNamed) {
  CameraModel model = optris();
  EXPECT_TRUE(check(model));
  model.fx = 0.0;
  EXPECT_FALSE(check(model));
  model = optris();
  model.cx = 500.0;
  EXPECT_FALSE(check(model));
  model = optris();
  model.coefficients[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(check(model));
  model = optris();
  model.width = 0;
  EXPECT_FALSE(check(model));
}

}  // namespace
}  // namespace adit::thermal_odometry
