// The messages the component publishes, against each other and against the world they were made in: points taken to the
// world by the published truth at each point's own time must lie on the world's surfaces.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/sensor_messages.hpp"
#include "idl/point_cloud_view.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit::tunnel_simulator {
namespace {

using Eigen::Vector3d;

template <class Stamp>
std::int64_t nanoseconds(const Stamp& stamp) {
  return 1'000'000'000LL * stamp.sec + stamp.nanosec;
}

template <class Translation, class Rotation>
Pose pose_of(const Translation& t, const Rotation& r) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
  pose.translation() = Vector3d(t.x, t.y, t.z);
  return pose;
}

// Keeps what the component would send.
class Recorder final : public Sink {
 public:
  explicit Recorder(const Simulation& simulation) : simulation_(simulation) {}
  void on_lidar(const LidarScan& scan, const Delivery& delivery) override {
    ASSERT_TRUE(fill(scan, delivery, clouds.emplace_back()));
  }
  void on_thermal(const ThermalImage& image, const Delivery& delivery) override {
    fill(image, delivery, simulation_.scenario(), frames.emplace_back());
  }
  void on_truth(double time, const Pose&) override {
    nav_msgs::msg::Odometry message;
    fill_truth(simulation_, time - simulation_.scenario().epoch, message);
    truth.push_back(
        {nanoseconds(message.header.stamp), pose_of(message.pose.pose.position, message.pose.pose.orientation)});
  }
  std::vector<sensor_msgs::msg::PointCloud2> clouds;
  std::vector<adit_msgs::msg::ThermalFrame> frames;
  Trajectory truth;

 private:
  const Simulation& simulation_;
};

// Distance to the triangle a, b, c.
double distance_to(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d normal = (b - a).cross(c - a);
  const auto inside = [&](const Vector3d& u, const Vector3d& v) { return (v - u).cross(p - u).dot(normal) >= 0.0; };
  if (normal.squaredNorm() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a)) {
    return std::abs(normal.normalized().dot(p - a));
  }
  const auto to_edge = [&](const Vector3d& u, const Vector3d& v) {
    const double length = (v - u).squaredNorm();
    const double t = length > 0.0 ? std::clamp((p - u).dot(v - u) / length, 0.0, 1.0) : 0.0;
    return (p - u - t * (v - u)).norm();
  };
  return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

// The world's triangles in cells of 1 m: no ray is cast, nothing is shared with the LiDAR model but the meshes.
class SurfaceIndex {
 public:
  static constexpr double kReach = 0.3;  // distances beyond are infinite [m]
  SurfaceIndex(const World& world, const Eigen::AlignedBox3d& region) {
    for (std::size_t i = 0; i < world.chunks().size(); ++i) {
      const Chunk& chunk = world.chunks()[i];
      if (!chunk.bounds.intersects(region)) continue;
      const Mesh mesh = world.build_mesh(i);
      for (const MeshTriangle& t : mesh.triangles) {
        const Vector3d centre = chunk.bounds.center();
        const std::array<Vector3d, 3> corners{mesh.vertices[t.a].position + centre,
                                              mesh.vertices[t.b].position + centre,
                                              mesh.vertices[t.c].position + centre};
        Eigen::AlignedBox3d box;
        for (const Vector3d& corner : corners) box.extend(corner);
        const Eigen::Vector3i low = cell(box.min().array() - kReach);
        const Eigen::Vector3i high = cell(box.max().array() + kReach);
        for (int x = low.x(); x <= high.x(); ++x) {
          for (int y = low.y(); y <= high.y(); ++y) {
            for (int z = low.z(); z <= high.z(); ++z) cells_[key({x, y, z})].push_back(triangles_.size());
          }
        }
        triangles_.push_back(corners);
      }
    }
  }
  double distance(const Vector3d& p) const {
    double least = std::numeric_limits<double>::infinity();
    const auto found = cells_.find(key(cell(p)));
    if (found == cells_.end()) return least;
    for (std::size_t i : found->second) {
      least = std::min(least, distance_to(p, triangles_[i][0], triangles_[i][1], triangles_[i][2]));
    }
    return least <= kReach ? least : std::numeric_limits<double>::infinity();
  }

 private:
  static Eigen::Vector3i cell(const Vector3d& p) { return p.array().floor().cast<int>(); }
  static std::int64_t key(const Eigen::Vector3i& c) {
    return (static_cast<std::int64_t>(c.x()) * 100003 + c.y()) * 100003 + c.z();
  }
  std::vector<std::array<Vector3d, 3>> triangles_;
  std::unordered_map<std::int64_t, std::vector<std::size_t>> cells_;
};

// The begin of S1: standing on the open apron, setting off, driving at 25 km/h, through the portal. One sweep and one
// frame at each of these times; between them the sensors are switched off, to save time.
constexpr std::array<double, 6> kTimes{0.5, 4.0, 8.0, 12.0, 14.0, 17.0};

Scenario begin_of_s1() {
  Scenario s = *load_scenario(std::string(ADIT_SOURCE_DIR) + "/bringup/scenarios/s01_zab_round_trip.yaml");
  s.imu_on = s.gnss_on = false;
  s.lidar.beams = *beam_table("os2_paper", 256);
  for (const auto& [sensor, period] :
       {std::pair{Sensor::lidar, 1.0 / s.lidar.rate}, std::pair{Sensor::thermal, 1.0 / s.thermal.rate}}) {
    double from = 0.0;
    for (const double time : kTimes) {
      s.outages.push_back({sensor, OutageMode::off, from, time - 1e-6 - from});
      from = time - 1e-6 + period;
    }
    s.outages.push_back({sensor, OutageMode::off, from, 100.0});
  }
  return s;
}

class PublishedTruth : public ::testing::Test {
 protected:
  void run(Scenario scenario) {
    simulation_ = *Simulation::create(std::move(scenario), 1);
    recorder_ = std::make_unique<Recorder>(*simulation_);
    simulation_->run(*recorder_, kTimes.back() + 0.2);
    tf2_msgs::msg::TFMessage rig;
    fill_rig(simulation_->scenario(), rig);
    for (const auto& t : rig.transforms) {
      if (t.child_frame_id == "lidar") lidar_ = pose_of(t.transform.translation, t.transform.rotation);
      if (t.child_frame_id == "thermal_optical") thermal_ = pose_of(t.transform.translation, t.transform.rotation);
    }
  }
  // Distances of a cloud's points, taken to the world at their own times (or a share of them), to what the world holds,
  // sorted; infinite for points in the air.
  std::vector<double> residuals(const sensor_msgs::msg::PointCloud2& cloud, const SurfaceIndex& surfaces,
                                double share_of_time = 1.0) const {
    const auto view = PointCloudView::of(cloud);
    PointColumns points;
    view->copy_to(points);
    std::vector<double> out;
    for (std::size_t i = 0; i < points.x.size(); i += 3) {
      const std::int64_t stamp = nanoseconds(cloud.header.stamp) + std::llround(1e9 * share_of_time * points.time[i]);
      const std::optional<Pose> base = interpolate(recorder_->truth, stamp);
      if (!base) continue;
      const Vector3d p = *base * lidar_ * Eigen::Vector3f(points.x[i], points.y[i], points.z[i]).cast<double>();
      out.push_back(surfaces.distance(p));
    }
    std::sort(out.begin(), out.end());
    return out;
  }

  std::unique_ptr<Simulation> simulation_;
  std::unique_ptr<Recorder> recorder_;
  Pose lidar_ = Pose::Identity(), thermal_ = Pose::Identity();
  const Eigen::AlignedBox3d region_{Vector3d(-300, -200, -50), Vector3d(300, 200, 100)};
};

TEST_F(PublishedTruth, PointsWithoutNoiseLieOnTheWorld) {
  Scenario s = begin_of_s1();
  s.thermal_on = false;
  s.lidar.noise = s.lidar.edges = false;
  run(std::move(s));
  ASSERT_EQ(recorder_->clouds.size(), kTimes.size());
  const SurfaceIndex surfaces(simulation_->world(), region_);
  for (std::size_t k = 0; k < kTimes.size(); ++k) {
    const std::vector<double> r = residuals(recorder_->clouds[k], surfaces);
    ASSERT_GT(r.size(), 5000U);
    EXPECT_LT(r.back(), 1e-3) << "at " << kTimes[k] << " s";
    if (kTimes[k] < 4.0) continue;
    // The test sees the motion: with all points at the sweep's begin they are off.
    const std::vector<double> wrong = residuals(recorder_->clouds[k], surfaces, 0.0);
    EXPECT_GT(wrong[wrong.size() * 9 / 10], 0.01) << "at " << kTimes[k] << " s";
  }
}

TEST_F(PublishedTruth, PointsWithNoiseAreOffByTheNoise) {
  Scenario s = begin_of_s1();
  s.thermal_on = false;
  run(std::move(s));
  ASSERT_EQ(recorder_->clouds.size(), kTimes.size());
  const SurfaceIndex surfaces(simulation_->world(), region_);
  for (std::size_t k = 0; k < kTimes.size(); ++k) {
    const std::vector<double> r = residuals(recorder_->clouds[k], surfaces);
    ASSERT_GT(r.size(), 5000U);
    // 25 mm along the beam at strong return, 84 mm at the detection limit; the distance to the surface is less.
    EXPECT_LT(r[r.size() / 2], 0.025) << "at " << kTimes[k] << " s";
    EXPECT_LT(r[r.size() * 95 / 100], 0.1) << "at " << kTimes[k] << " s";
    EXPECT_LT(r[r.size() * 98 / 100], 0.3) << "at " << kTimes[k] << " s";  // mixed pixels at edges
  }
}

// A row of a frame is what a camera shows that stands still where the published truth has it at that row's time.
TEST_F(PublishedTruth, ThermalRowsAreSeenFromTheirOwnPoses) {
  Scenario s = begin_of_s1();
  s.lidar_on = false;
  s.thermal.noise = s.thermal.edges = false;
  s.thermal.blur = s.thermal.time_constant = 0.0;
  ThermalConfig still = s.thermal;
  still.row_time = 0.0;
  ThermalCamera camera(still, 1);
  run(std::move(s));
  ASSERT_EQ(recorder_->frames.size(), kTimes.size());
  for (std::size_t k = 1; k < kTimes.size(); k += 2) {
    const adit_msgs::msg::ThermalFrame& frame = recorder_->frames[k];
    const auto* counts = reinterpret_cast<const std::uint16_t*>(frame.data.data());
    const auto same_share = [&](std::uint32_t row, double time_of_row) {
      const std::int64_t stamp = nanoseconds(frame.header.stamp) + std::llround(1e9 * time_of_row);
      const Pose pose = *interpolate(recorder_->truth, stamp) * thermal_;
      simulation_->caster().look_from(pose.translation());
      ThermalImage image;
      camera.capture(
          simulation_->caster(), {}, [&](double) { return pose; }, 0.0, 0, 1, image);
      std::uint32_t same = 0;
      for (std::uint32_t x = 0; x < frame.width; ++x) {
        const std::size_t i = row * frame.width + x;
        same += std::abs(static_cast<int>(counts[i]) - static_cast<int>(image.counts[i])) <= 1 ? 1U : 0U;
      }
      return static_cast<double>(same) / frame.width;
    };
    const double row_time = static_cast<double>(frame.readout_time) / frame.height;
    for (const std::uint32_t row : {0U, 250U, 511U}) {
      EXPECT_GT(same_share(row, row * row_time), 0.97) << "row " << row << " at " << kTimes[k] << " s";
    }
    EXPECT_LT(same_share(511, -0.2), 0.9) << "at " << kTimes[k] << " s";  // the test sees the motion
  }
}

}  // namespace
}  // namespace adit::tunnel_simulator
