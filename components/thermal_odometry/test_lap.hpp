// Frames and clouds of a drive through the scene of tests, there and back again, rendered once.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "components/thermal_odometry/test_scene.hpp"
#include "idl/point_cloud_writer.hpp"

namespace adit::thermal_odometry {

class TestLap {
 public:
  static constexpr int frames = 600;    // there and back
  static constexpr int scan_every = 3;  // frames
  // Metres; at 25 frames/s the fastest frame moves at furthest * pi / frames * 25 = 3.9 m/s.
  static constexpr double furthest = 30.0;

  TestLap() {
    scene_.camera = {160, 128, 105.0, 105.0, 79.5, 63.5, Distortion::none, {}};
    for (int k = 0; k < frames; ++k) {
      const Pose pose = pose_at(k);
      const Frame frame = scene_.render(pose, 0);
      pictures_.emplace_back(frame.data, frame.data + static_cast<std::ptrdiff_t>(frame.width) * frame.height);
      if (k % scan_every != 0) continue;
      const DepthPoints scan = scene_.scan(pose, 0);
      std::vector<LidarPoint> points;
      for (std::size_t i = 0; i < scan.points.size(); i += 3) {
        const Eigen::Vector3f& p = scan.points[i];
        points.push_back({p.x(), p.y(), p.z(), 1.0F, 0.0, 0});
      }
      clouds_.push_back(std::move(points));
    }
  }
  static Pose pose_at(int k) {
    const double phase = 2.0 * M_PI * k / frames;
    Pose pose = TestScene::drive(3.0 * std::sin(phase), 0.0);  // the sway of the drive, closed after a lap
    pose.translation().z() = 0.5 * furthest * (1.0 - std::cos(phase));
    return pose;
  }
  const CameraModel& camera() const { return scene_.camera; }
  const std::vector<std::uint16_t>& picture(int k) const { return pictures_[static_cast<std::size_t>(k)]; }
  const std::vector<LidarPoint>& cloud(int k) const { return clouds_[static_cast<std::size_t>(k / scan_every)]; }

 private:
  TestScene scene_;
  std::vector<std::vector<std::uint16_t>> pictures_;
  std::vector<std::vector<LidarPoint>> clouds_;
};

}  // namespace adit::thermal_odometry
