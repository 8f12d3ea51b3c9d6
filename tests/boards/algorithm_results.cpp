// Poses of the on-board algorithms on synthetic input, printed exactly (hexadecimal): one line a pose. The same program
// runs on the host and, emulated, on each board's architecture; compare_results.py holds the outputs together.
#include <cstdio>
#include <memory>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_scene.hpp"
#include "components/state_estimator/state_estimator.hpp"
#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit {
namespace {

void print(const char* algorithm, std::int64_t stamp_ns, const Pose& pose) {
  const Eigen::Quaterniond q(pose.rotation());
  const Eigen::Vector3d t = pose.translation();
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  std::printf("%s %lld %a %a %a %a %a %a %a\n", algorithm, static_cast<long long>(stamp_ns), t.x(), t.y(), t.z(),
              sign * q.x(), sign * q.y(), sign * q.z(), sign * q.w());
}

// A drive through a furnished hall; the estimator fuses what the odometry says.
bool lidar(lidar_odometry::Mode mode, const char* name, bool fuse) {
  lidar_odometry::Config config;
  config.mode = mode;
  lidar_odometry::LidarOdometry odometry(config);
  auto estimator = state_estimator::StateEstimator::create(state_estimator::Config::standard());
  if (!estimator) return false;
  const int sensor = (*estimator)->sensor("lidar");
  lidar_odometry::ScannerModel model;
  model.rings = 16;
  model.columns = 256;
  const lidar_odometry::Scene hall = lidar_odometry::hall();
  Pose pose = Pose::Identity();
  for (int k = 0; k < 25; ++k) {
    Vector6d twist;
    twist << 1.0, 0.1, 0.0, 0.0, 0.0, 0.1;
    twist *= std::clamp(0.1 * (k - 1), 0.0, 1.0);
    if (k > 0) pose = pose * se3_exp(model.period * twist);
    const std::int64_t stamp = k * 100'000'000LL;
    const auto sweep = lidar_odometry::scan(hall, model, pose, twist, stamp, static_cast<unsigned>(k + 1));
    const lidar_odometry::Estimate& estimate = odometry.process(sweep.cloud());
    print(name, estimate.stamp_ns, estimate.pose);
    if (!fuse || !lidar_odometry::registered(estimate.status)) continue;
    state_estimator::OdometrySample sample;
    sample.stamp_ns = estimate.stamp_ns;
    sample.pose = estimate.pose;
    sample.information = estimate.information;
    (*estimator)->add_odometry(sensor, sample, estimate.stamp_ns);
    if (const auto fused = (*estimator)->estimate(estimate.stamp_ns)) print("fusion", fused->stamp_ns, fused->pose);
  }
  return true;
}

bool thermal() {
  using namespace thermal_odometry;
  TestScene scene;
  auto odometry = ThermalOdometry::create(scene.camera, Config{});
  if (!odometry) return false;
  for (int i = 0; i < 40; ++i) {
    const Pose pose = TestScene::drive(0.04 * i, 4.0);
    const std::int64_t stamp = i * 40'000'000LL;
    const bool scan = i % 3 == 0;
    const DepthPoints cloud = scan ? scene.scan(pose, stamp) : DepthPoints{};
    print("thermal", stamp,
          (*odometry)->process(scene.render(pose, stamp), nullptr, scan ? &cloud : nullptr).T_odom_camera);
  }
  return true;
}

}  // namespace
}  // namespace adit

int main() {
  using adit::lidar_odometry::Mode;
  const bool done = adit::lidar(Mode::kiss, "lidar_kiss", false) && adit::lidar(Mode::genz, "lidar_genz", false) &&
                    adit::lidar(Mode::default_, "lidar_default", true) && adit::thermal();
  return done ? 0 : 1;
}
