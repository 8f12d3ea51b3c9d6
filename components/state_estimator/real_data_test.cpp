// A walking robot in a real building (subt_anymal_vlp16): its stored odometry, its IMU, and scan matches of our LiDAR
// odometry 5 s apart (test_data/), against the set's reference. Skipped where the shared data is absent.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "components/geometry/trajectory.hpp"
#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

std::optional<std::string> shared_set() {
  const char* const given = std::getenv("ADIT_SHARED");
  const std::filesystem::path source = std::filesystem::path(ADIT_SOURCE_DIR);
  for (const std::filesystem::path& root : {std::filesystem::path(given ? given : ""), source / "../shared"}) {
    const std::filesystem::path folder = root / "data" / "subt_anymal_vlp16";
    if (std::filesystem::exists(folder / "imu.csv")) return folder.string();
  }
  return std::nullopt;
}

std::vector<std::vector<double>> read_csv(const std::string& path, std::vector<std::int64_t>& stamps,
                                          int stamp_columns) {
  std::vector<std::vector<double>> rows;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    std::string field;
    std::vector<double> row;
    for (int column = 0; std::getline(fields, field, ','); ++column) {
      if (column < stamp_columns) {
        stamps.push_back(std::stoll(field));
      } else {
        row.push_back(std::stod(field));
      }
    }
    rows.push_back(row);
  }
  return rows;
}

struct Input {
  std::int64_t stamp_ns;
  int kind;  // 0 IMU, 1 stored odometry, 2 scan match: at equal stamps in this order
  std::size_t index;
};

struct Figures {
  double end_m = 0.0, end_deg = 0.0, end_yaw_deg = 0.0, ate_m = 0.0, mean_nis = 0.0;
};

struct Sources {
  bool odometry = true, imu = true, scans = true;
};

// body = the IMU frame; sensor 0: scan matches, sensor 1: stored odometry.
Figures fuse(const std::string& folder, const Sources& use) {
  const Trajectory reference = *read_tum(folder + "/ref_imu.tum");
  const Trajectory scans =
      *read_tum(std::string(ADIT_SOURCE_DIR) + "/components/state_estimator/test_data/subt_scan_matches.tum");
  const Trajectory stored = *read_tum(folder + "/maplab_vertices_imu.tum");
  std::vector<std::int64_t> imu_stamps;
  const std::vector<std::vector<double>> imu = read_csv(folder + "/imu.csv", imu_stamps, 1);

  Config config = Config::standard();
  config.process.noise.jerk = 10.0;  // a walking robot
  config.process.noise.yaw_jerk = 10.0;
  config.process.noise.position = 0.1;  // it also steps sideways
  config.replay.history_s = 12.0;
  config.outage_s = 6.0;
  for (OdometrySensor& o : config.odometries) {
    o.odometry.calibration = {};
    o.odometry.max_interval_s = 6.0;
    o.odometry.position_fraction = 0.0;
  }
  OdometryConfig& lidar = config.odometries[0].odometry;
  lidar.body_from_sensor.matrix() << 0.9999874213511631, -0.004957927403632594, -0.0007590094278570014,
      -0.02715030606424891, 0.00495486045362637, 0.9999797618555115, -0.003990643717431052, 0.04506446949568683,
      0.0007787793887593181, 0.00398683273472708, 0.9999917492996675, 0.04861247181001468, 0, 0, 0, 1;
  lidar.sigma_position = 0.02;
  lidar.sigma_yaw = 0.003;
  OdometryConfig& odometry = config.odometries[1].odometry;
  odometry.sigma_position = 0.03;  // the set's own figures
  odometry.sigma_yaw = 0.07;
  config.imu.enabled = use.imu;
  config.imu.use_acceleration = false;  // feet on the ground: 1 to 2 m/s^2 of shocks
  config.imu.sigma_yaw_rate = 0.05;
  config.imu.yaw_rate_bias = 0.02;
  const Pose& first = reference.front().pose;
  config.initial.x = first.translation().x();
  config.initial.y = first.translation().y();
  config.initial.yaw = yaw(first.linear());
  std::unique_ptr<StateEstimator> estimator = std::move(*StateEstimator::create(config));
  estimator->start(reference.front().stamp_ns);

  std::vector<Input> inputs;
  for (std::size_t i = 0; i < imu_stamps.size() && use.imu; ++i) inputs.push_back({imu_stamps[i], 0, i});
  for (std::size_t i = 0; i < stored.size() && use.odometry; ++i) inputs.push_back({stored[i].stamp_ns, 1, i});
  for (std::size_t i = 0; i < scans.size() && use.scans; ++i) inputs.push_back({scans[i].stamp_ns, 2, i});
  std::sort(inputs.begin(), inputs.end(),
            [](const Input& a, const Input& b) { return std::tie(a.stamp_ns, a.kind) < std::tie(b.stamp_ns, b.kind); });

  std::vector<Pose> estimates;
  const auto record_until = [&](std::int64_t stamp) {
    while (estimates.size() < reference.size() && reference[estimates.size()].stamp_ns < stamp) {
      const std::optional<Estimate> e = estimator->estimate(reference[estimates.size()].stamp_ns);
      EXPECT_TRUE(e && e->pose.matrix().allFinite());
      estimates.push_back(e ? e->pose : Pose::Identity());
    }
  };
  for (const Input& in : inputs) {
    if (in.stamp_ns < reference.front().stamp_ns) continue;
    record_until(in.stamp_ns);
    if (in.kind == 0) {
      const std::vector<double>& row = imu[in.index];
      ImuSample sample;
      sample.stamp_ns = in.stamp_ns;
      sample.specific_force = {row[0], row[1], row[2]};
      sample.angular_rate = {row[3], row[4], row[5]};
      estimator->add_imu(sample, in.stamp_ns);
    } else {
      OdometrySample sample;
      sample.stamp_ns = in.stamp_ns;
      sample.pose = in.kind == 1 ? stored[in.index].pose : scans[in.index].pose;
      estimator->add_odometry(in.kind == 1 ? 1 : 0, sample, in.stamp_ns);
    }
  }
  record_until(std::numeric_limits<std::int64_t>::max());

  Figures f;
  double squares = 0.0;
  Pose error = Pose::Identity();
  for (std::size_t i = 0; i < reference.size(); ++i) {
    error = (first.inverse() * reference[i].pose).inverse() * (estimates[0].inverse() * estimates[i]);
    squares += error.translation().squaredNorm();
  }
  f.ate_m = std::sqrt(squares / static_cast<double>(reference.size()));
  f.end_m = error.translation().norm();
  f.end_deg = so3_log(error.linear()).norm() * 180.0 / std::numbers::pi;
  f.end_yaw_deg = std::abs(yaw(error.linear())) * 180.0 / std::numbers::pi;
  const Status status = estimator->status(reference.back().stamp_ns);
  std::printf("%s%s%s: end %.3f m %.2f deg (yaw %.2f), ATE %.3f m;", use.odometry ? "odometry " : "",
              use.imu ? "imu " : "", use.scans ? "scans" : "", f.end_m, f.end_deg, f.end_yaw_deg, f.ate_m);
  for (const SensorReport& r : status.sensors) {
    std::printf(" %s %llu+%llu NIS %.2f", r.name.c_str(), static_cast<unsigned long long>(r.accepted),
                static_cast<unsigned long long>(r.rejected + r.distrusted_count), r.mean_nis_per_dof);
  }
  std::printf("\n");
  return f;
}

TEST(RealData, FusionBeatsTheStoredOdometryFiveTimes) {
  const std::optional<std::string> folder = shared_set();
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  fuse(*folder, {.odometry = true, .imu = false, .scans = false});
  fuse(*folder, {.odometry = true, .imu = true, .scans = false});
  fuse(*folder, {.odometry = false, .imu = true, .scans = true});
  const Figures all = fuse(*folder, {});
  // The stored odometry ends 1.1 m and 5.9 degrees off.
  EXPECT_LT(all.end_m, 1.1 / 5.0);
  EXPECT_LT(all.end_deg, 5.9 / 5.0);
}

}  // namespace
}  // namespace adit::state_estimator
