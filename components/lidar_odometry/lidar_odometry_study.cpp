// Runs the odometry over the shared recordings and prints its figures; for studies, not a test.
//   lidar_odometry_study synthetic kiss|genz|default raw|deskew [scans]
//   lidar_odometry_study shuttle kiss|genz|default SWEEPS [START_X]
//   lidar_odometry_study spread kiss|genz|default raw|deskew [seeds]
//   lidar_odometry_study scene kiss|genz|default hall|smooth|furnished|portal SPEED SCANS [none|PRIOR_PERCENT] [rings
//   columns] lidar_odometry_study subt kiss|genz|default [max_range] [voxel]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <random>
#include <string>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_scene.hpp"

using namespace adit;
using namespace adit::lidar_odometry;

namespace {

std::vector<Pose> poses_of(const std::string& path) {
  std::vector<Pose> poses;
  const Result<Trajectory> trajectory = read_tum(path);
  if (!trajectory) {
    std::fprintf(stderr, "%s\n", trajectory.error().message.c_str());
    return poses;
  }
  for (const StampedPose& p : *trajectory) poses.push_back(p.pose);
  return poses;
}

void print(const char* name, const TrajectoryError& e) {
  std::printf("%-28s ATE %.3f m  end %.3f m %.2f %% %.2f deg\n", name, e.ate, e.end, e.end_percent, e.end_degrees);
}

int synthetic(Config config, bool deskew) {
  const std::string folder = *shared_data("synthetic_lidar_64x512");
  config.deskew = deskew;
  LidarOdometry odometry(config);
  std::vector<Pose> estimate;
  const std::vector<Pose> start = poses_of(folder + "/gt_start.tum");
  const std::vector<Pose> mid = poses_of(folder + "/gt_mid.tum");
  const std::vector<Pose> end = poses_of(folder + "/gt_end.tum");
  const bool genz = config.mode == Mode::genz;
  const std::string name = std::string(genz ? "genz" : "kiss") + (deskew ? "_deskew" : "_raw");
  const std::vector<Pose> published = poses_of(folder + "/reference_" + name + ".tum");
  std::size_t i = 0;
  for (const RecordedSweep& sweep : read_sweeps(folder)) {
    const Estimate& e = odometry.process(sweep.cloud());
    estimate.push_back(e.pose);
    const double step = i > 0 ? (estimate[i - 1].inverse() * estimate[i]).translation().norm() : 0.0;
    const double truth = i > 0 ? (mid[i - 1].inverse() * mid[i]).translation().norm() : 0.0;
    const double other = i > 0 ? (published[i - 1].inverse() * published[i]).translation().norm() : 0.0;
    const std::vector<Pose>& gt = config.mode == Mode::genz ? mid : end;
    const Vector6d d =
        i == 0 ? Vector6d::Zero().eval()
               : se3_log((gt[i - 1].inverse() * gt[i]).inverse() * (estimate[i - 1].inverse() * estimate[i]));
    const Vector6d total = se3_log((gt[0].inverse() * gt[i]).inverse() * (estimate[0].inverse() * estimate[i]));
    std::printf(
        "%2zu %-12s step %.3f published %.3f truth %.3f err %6.3f %6.3f %6.3f m %6.3f %6.3f %6.3f deg total %6.3f "
        "%6.3f "
        "%6.3f nees %.1f ",
        i, std::string(to_string(e.status)).c_str(), step, other, truth, d[0], d[1], d[2], d[3] * 57.3, d[4] * 57.3,
        d[5] * 57.3, total[0], total[1], total[2], d.dot(e.information * d));
    std::printf("n %u matched %u assoc %u solves %u cap %d rms %.3f cells %u weak %d s", e.scan.registered,
                e.scan.matched, e.scan.associations, e.scan.solves, e.scan.iteration_cap, e.scan.rms_residual,
                e.scan.map_cells, e.localizability.unobservable());
    for (const Direction& l : e.localizability.translation) std::printf(" %.4f", l.sigma);
    for (const Direction& l : e.localizability.rotation) std::printf(" %.5f", l.sigma);
    std::printf("\n");
    ++i;
  }
  print("ours vs mid", trajectory_error(mid, estimate));
  print("ours vs end", trajectory_error(end, estimate));
  print("published vs mid", trajectory_error(mid, published));
  print("published vs end", trajectory_error(end, published));
  print("ours vs published", trajectory_error(published, estimate));
  return 0;
}

// The same drive with 1 mm of noise added to every point, once for each seed: how far chance alone moves the figures.
int spread(Config config, bool deskew, int seeds) {
  const std::string folder = *shared_data("synthetic_lidar_64x512");
  config.deskew = deskew;
  const std::vector<Pose> truth = poses_of(folder + (config.mode == Mode::genz ? "/gt_mid.tum" : "/gt_end.tum"));
  for (int seed = 0; seed < seeds; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::uniform_real_distribution<float> noise(-0.001f, 0.001f);
    LidarOdometry odometry(config);
    std::vector<Pose> estimate;
    for (RecordedSweep& sweep : read_sweeps(folder)) {
      for (Point3f& point : sweep.points) point += Point3f(noise(random), noise(random), noise(random));
      estimate.push_back(odometry.process(sweep.cloud()).pose);
    }
    print(("seed " + std::to_string(seed)).c_str(), trajectory_error(truth, estimate));
  }
  return 0;
}

// A drive along a generated scene: at rest for 10 sweeps, then with 3 m/s^2 to the speed. prior_percent: error of a
// wheel-like prior; nan: none.
int scene(Config config, const std::string& name, double speed, int scans, double prior_percent, ScannerModel model) {
  const Scene world = name == "hall"        ? hall()
                      : name == "smooth"    ? smooth_tunnel()
                      : name == "furnished" ? furnished_tunnel()
                                            : furnished_tunnel(-80.0, 40.0);
  LidarOdometry odometry(config);
  Pose pose = Pose::Identity();
  std::vector<Pose> truth, estimate;
  int flagged = 0;
  double nees = 0.0, solves = 0.0, cpu = 0.0;
  std::vector<double> times;
  for (int k = 0; k < scans; ++k) {
    Vector6d twist = Vector6d::Zero();
    twist[0] = std::clamp(0.3 * (k - 9), 0.0, speed);
    twist[5] = 0.0015 * twist[0] * std::sin(0.05 * k);
    if (k > 0) pose = pose * se3_exp(model.period * twist);
    truth.push_back(pose);
    const RecordedSweep sweep = scan(world, model, pose, twist, k * 100'000'000LL, static_cast<unsigned>(k));
    Prior prior;
    Vector6d wheel = model.period * twist;
    wheel[0] *= 1.0 + 0.01 * prior_percent;
    prior.pose = se3_exp(wheel);
    const double sigma = 0.015 * std::abs(wheel[0]) + 0.003;
    prior.information.diagonal() << 1.0 / (sigma * sigma), 1e4, 1e4, 2.5e5, 2.5e5, 2.5e5;
    const std::clock_t begin = std::clock();
    const Estimate& e = odometry.process(sweep.cloud(), std::isnan(prior_percent) ? nullptr : &prior);
    times.push_back(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    cpu += times.back();
    estimate.push_back(e.pose);
    if (k == 0) continue;
    const bool weak = !e.localizability.translation[0].observable;
    flagged += weak ? 1 : 0;
    const Vector6d d = se3_log((truth[truth.size() - 2].inverse() * pose).inverse() *
                               (estimate[estimate.size() - 2].inverse() * e.pose));
    nees += d.dot(e.information * d);
    solves += e.scan.solves;
    const Vector6d total = se3_log(pose.inverse() * e.pose);
    if (k % std::max(1, scans / 20) == 0 || e.status == Status::lost) {
      std::printf(
          "%3d %-10s x %.2f total %6.3f %6.3f %6.3f m %5.2f %5.2f %5.2f deg axis %.3f %.3f sigma %.4f  n %u matched %u "
          "solves %u cells %u\n",
          k, std::string(to_string(e.status)).c_str(), pose.translation().x(), total[0], total[1], total[2],
          total[3] * 57.3, total[4] * 57.3, total[5] * 57.3, e.localizability.translation[0].axis.x(),
          e.localizability.translation[0].axis.y(), e.localizability.translation[0].sigma, e.scan.registered,
          e.scan.matched, e.scan.solves, e.scan.map_cells);
    }
  }
  print("ours vs truth", trajectory_error(truth, estimate));
  std::sort(times.begin(), times.end());
  std::printf("flagged %.1f %%  nees %.2f  solves %.1f  ms mean %.1f median %.1f p95 %.1f max %.1f\n",
              100.0 * flagged / (scans - 1), nees / (scans - 1), solves / (scans - 1), cpu / scans,
              times[times.size() / 2], times[times.size() * 95 / 100], times.back());
  return 0;
}

// To and fro over the same 41 sweeps of a furnished tunnel, START_X metres from the origin: does a sweep cost the same
// after hours, and far away?
int shuttle(const Config& config, int sweeps, double start) {
  ScannerModel model;
  model.rings = 128;
  model.columns = 1024;
  model.times = false;
  std::vector<RecordedSweep> recorded;
  const auto way = [](int k) { return 5.0 * (1.0 - std::cos(M_PI * k / 40.0)); };
  for (int k = 0; k <= 40; ++k) {
    Pose pose = Pose::Identity();
    pose.translation().x() = way(k);
    recorded.push_back(scan(furnished_tunnel(-40.0, 60.0), model, pose, Vector6d::Zero(), 0, static_cast<unsigned>(k)));
  }
  LidarOdometry odometry(config);
  Prior first;
  first.kind = Prior::Kind::absolute;
  first.pose.translation().x() = start;
  std::vector<double> times;
  double largest = 0.0;
  for (int i = 0; i < sweeps; ++i) {
    const int k = i % 80 <= 40 ? i % 80 : 80 - i % 80;
    Cloud cloud = recorded[static_cast<std::size_t>(k)].cloud();
    cloud.stamp_ns = 100'000'000LL * i;
    const std::clock_t begin = std::clock();
    const Estimate& e = odometry.process(cloud, i == 0 ? &first : nullptr);
    times.push_back(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    largest = std::max(largest, (e.pose.translation() - Eigen::Vector3d(start + way(k), 0.0, 0.0)).norm());
    if (i == 100 || i == 1000 || i + 1 == sweeps) std::printf("sweep %d: resident %.2f MB\n", i, resident_megabytes());
  }
  const auto median = [&](std::size_t from, std::size_t to) {
    std::vector<double> part(times.begin() + static_cast<std::ptrdiff_t>(from),
                             times.begin() + static_cast<std::ptrdiff_t>(to));
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2), part.end());
    return part[part.size() / 2];
  };
  std::printf("median ms of sweeps 100-200 %.2f, of the last 100 %.2f; largest error %.3f m\n", median(100, 200),
              median(times.size() - 100, times.size()), largest);
  return 0;
}

// A recording of a sensor at rest: every step is an error.
int standing(const Config& config, const std::string& name, std::int64_t unit) {
  LidarOdometry odometry(config);
  Pose last = Pose::Identity();
  for (const RecordedSweep& sweep : read_sweeps(*shared_data(name), unit)) {
    const Estimate& e = odometry.process(sweep.cloud());
    const Vector6d d = se3_log(last.inverse() * e.pose);
    last = e.pose;
    std::printf(
        "%-12s step %.2f mm %.4f deg  total %.2f mm %.4f deg n %u matched %u solves %u weak %d sigma %.4f %.5f\n",
        std::string(to_string(e.status)).c_str(), 1e3 * d.head<3>().norm(), 57.3 * d.tail<3>().norm(),
        1e3 * e.pose.translation().norm(), 57.3 * so3_log(e.pose.linear()).norm(), e.scan.registered, e.scan.matched,
        e.scan.solves, e.localizability.unobservable(), e.localizability.translation[0].sigma,
        e.localizability.rotation[0].sigma);
  }
  return 0;
}

int pair(const Config& config) {
  const std::string folder = *shared_data("small_gicp_pair");
  std::ifstream file(folder + "/T_target_source.txt");
  Pose truth = Pose::Identity();
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) file >> truth.matrix()(r, c);
  }
  LidarOdometry odometry(config);
  RecordedSweep target, source;
  target.points = read_ply(folder + "/target.ply");
  source.points = read_ply(folder + "/source.ply");
  source.stamp_ns = 100'000'000;
  odometry.process(target.cloud());
  const Estimate& e = odometry.process(source.cloud());
  const Vector6d d = se3_log(truth.inverse() * e.pose);
  std::printf("error by axis %.4f %.4f %.4f m %.3f %.3f %.3f deg\n", d[0], d[1], d[2], 57.3 * d[3], 57.3 * d[4],
              57.3 * d[5]);
  std::printf("%s error %.4f m %.3f deg n %u matched %u solves %u weak %d\n", std::string(to_string(e.status)).c_str(),
              d.head<3>().norm(), 57.3 * d.tail<3>().norm(), e.scan.registered, e.scan.matched, e.scan.solves,
              e.localizability.unobservable());
  return 0;
}

int subt(const Config& config, double sigma_t, double sigma_r) {
  const std::string folder = *shared_data("subt_anymal_vlp16");
  LidarOdometry odometry(config);
  const std::vector<Pose> stored = poses_of(folder + "/maplab_lidar.tum");
  const std::vector<Pose> reference = poses_of(folder + "/ref_lidar.tum");
  std::vector<Pose> estimate;
  for (const RecordedSweep& sweep : read_sweeps(folder)) {
    const std::size_t i = estimate.size();
    Prior prior;
    if (i > 0) prior.pose = stored[i - 1].inverse() * stored[i];
    if (sigma_t > 0.0) {
      prior.information.diagonal() << Eigen::Vector3d::Constant(1.0 / (sigma_t * sigma_t)),
          Eigen::Vector3d::Constant(1.0 / (sigma_r * sigma_r));
    }
    const Estimate& e = odometry.process(sweep.cloud(), &prior);
    estimate.push_back(e.pose);
    const Pose d = (reference[0].inverse() * reference[i]).inverse() * (estimate[0].inverse() * e.pose);
    const Pose p = i == 0 ? Pose::Identity() : Pose((reference[i - 1].inverse() * reference[i]).inverse() * prior.pose);
    std::printf(
        "%2zu %-12s error %.3f m %.2f deg  prior step error %.3f m %.2f deg  n %u matched %u solves %u cap %d rms %.3f "
        "cells %u weak %d\n",
        i, std::string(to_string(e.status)).c_str(), d.translation().norm(), so3_log(d.linear()).norm() * 57.29578,
        p.translation().norm(), so3_log(p.linear()).norm() * 57.29578, e.scan.registered, e.scan.matched, e.scan.solves,
        e.scan.iteration_cap, e.scan.rms_residual, e.scan.map_cells, e.localizability.unobservable());
  }
  print("ours vs reference", trajectory_error(reference, estimate));
  print("stored vs reference", trajectory_error(reference, stored));
  return 0;
}

}  // namespace

// Takes "name=value" arguments for the settings of mode default out of the command line.
void take_settings(int& argc, char** argv, SurfelConfig& c) {
  const std::pair<const char*, double*> settings[] = {{"selection_cell", &c.selection_cell},
                                                      {"range_sigma", &c.range_sigma},
                                                      {"max_extent", &c.max_extent},
                                                      {"min_width", &c.min_width},
                                                      {"planarity", &c.planarity},
                                                      {"max_thickness", &c.max_thickness},
                                                      {"cell_size", &c.cell_size},
                                                      {"residual_sigma", &c.residual_sigma},
                                                      {"common_tilt", &c.common_tilt},
                                                      {"max_acceleration", &c.max_acceleration},
                                                      {"max_angular_acceleration", &c.max_angular_acceleration},
                                                      {"deskew_share", &c.deskew_share}};
  int kept = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos) {
      argv[kept++] = argv[i];
      continue;
    }
    const std::string name = text.substr(0, equals);
    const double value = std::atof(text.c_str() + equals + 1);
    if (name == "block_columns") c.block_columns = static_cast<std::size_t>(value);
    if (name == "min_surfels") c.min_surfels = static_cast<std::size_t>(value);
    if (name == "block_rows") c.block_rows = static_cast<std::size_t>(value);
    for (const auto& [key, target] : settings) {
      if (name == key) *target = value;
    }
  }
  argc = kept;
}

int main(int argc, char** argv) {
  Config config;
  take_settings(argc, argv, config.surfel);
  const auto arg = [&](int i) { return std::string(argc > i ? argv[i] : ""); };
  config.mode = mode_from_string(arg(2)).value_or(Mode::kiss);
  if (arg(1) == "synthetic") return synthetic(config, arg(3) != "raw");
  if (arg(1) == "shuttle") return shuttle(config, std::max(400, std::atoi(arg(3).c_str())), std::atof(arg(4).c_str()));
  if (arg(1) == "spread") return spread(config, arg(3) != "raw", argc > 4 ? std::atoi(argv[4]) : 10);
  if (arg(1) == "scene") {
    ScannerModel model;
    model.rings = argc > 7 ? std::atoi(argv[7]) : 64;
    model.columns = argc > 8 ? std::atoi(argv[8]) : 512;
    return scene(config, arg(3), std::atof(arg(4).c_str()), std::atoi(arg(5).c_str()),
                 arg(6).empty() || arg(6) == "none" ? std::nan("") : std::atof(arg(6).c_str()), model);
  }
  if (arg(1) == "opencalib") return standing(config, "opencalib_static_64", 1);
  if (arg(1) == "vlp16") return standing(config, "vlp16_static", 1000);
  if (arg(1) == "pair") return pair(config);
  if (arg(1) == "subt") {
    if (argc > 3) config.max_range = std::atof(argv[3]);
    if (argc > 4) config.kiss.voxel_size = config.genz.voxel_size = std::atof(argv[4]);
    if (argc > 5) config.kiss.initial_threshold = config.genz.initial_threshold = std::atof(argv[5]);
    return subt(config, argc > 6 ? std::atof(argv[6]) : 0.0, argc > 7 ? std::atof(argv[7]) : 1.0);
  }
  return 1;
}
