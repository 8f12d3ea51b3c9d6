// Runs the odometry over a folder of the tunnel simulator (`adit simulate`) and prints its figures; a study, no test.
//   lidar_odometry_drive FOLDER [mode=default] [first=0] [scans=N] [every=20] [prior=PERCENT] [organised=1] [tum=FILE]
//   [imu=1: with the folder's IMU] [from=0: sweeps before this one are not counted in shares and largest errors]
// prior: wheel and gyroscope with this scale error of the way. organised=0: the points as the folder has them.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>

#include "components/geometry/trajectory.hpp"
#include "components/lidar_odometry/inertial_predictor.hpp"
#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_data.hpp"

using namespace adit;
using namespace adit::lidar_odometry;

namespace {

constexpr double degrees = 57.29577951308232;

// The full image of a sweep: the simulator leaves out what gave no return; a column is one firing time.
RecordedSweep organised(const RecordedSweep& sweep, std::size_t rows, std::size_t columns, double period) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  RecordedSweep image;
  image.stamp_ns = sweep.stamp_ns;
  image.width = columns;
  image.height = rows;
  image.points.assign(rows * columns, Point3f(nan, nan, nan));
  image.seconds.resize(rows * columns);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      image.seconds[r * columns + c] =
          static_cast<float>(period * static_cast<double>(c) / static_cast<double>(columns));
    }
  }
  for (std::size_t i = 0; i < sweep.points.size(); ++i) {
    const auto column = static_cast<std::size_t>(
        std::lround(static_cast<double>(sweep.seconds[i]) / period * static_cast<double>(columns)));
    if (column >= columns || sweep.rings[i] >= rows) continue;
    image.points[sweep.rings[i] * columns + column] = sweep.points[i];
    image.seconds[sweep.rings[i] * columns + column] = sweep.seconds[i];
  }
  return image;
}

// The folder's imu.csv: stamp [ns], specific force, rate.
std::vector<InertialSample> read_imu(const std::string& folder) {
  std::vector<InertialSample> samples;
  std::ifstream file(folder + "/imu.csv");
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    InertialSample s;
    fields >> s.stamp_ns >> s.acceleration.x() >> s.acceleration.y() >> s.acceleration.z() >> s.rate.x() >>
        s.rate.y() >> s.rate.z();
    samples.push_back(s);
  }
  return samples;
}

// A matrix of the folder's extrinsics.yaml.
Pose read_extrinsic(const std::string& folder, const std::string& name) {
  std::ifstream file(folder + "/extrinsics.yaml");
  std::string line;
  while (std::getline(file, line) && line != name + ":") {
  }
  Pose pose = Pose::Identity();
  for (int row = 0; row < 3 && std::getline(file, line); ++row) {
    for (char& c : line) {
      if (c == '[' || c == ']' || c == ',') c = ' ';
    }
    line[line.find('-')] = ' ';
    std::istringstream fields(line);
    for (int column = 0; column < 4; ++column) fields >> pose.matrix()(row, column);
  }
  return pose;
}

// Mean relative error of the translation over pieces of a length, in percent.
double piecewise(const std::vector<Pose>& truth, const std::vector<Pose>& estimate, double length) {
  std::vector<double> way{0.0};
  for (std::size_t i = 1; i < truth.size(); ++i) {
    way.push_back(way.back() + (truth[i].translation() - truth[i - 1].translation()).norm());
  }
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const auto end = std::lower_bound(way.begin(), way.end(), way[i] + length);
    if (end == way.end()) break;
    const auto j = static_cast<std::size_t>(end - way.begin());
    const Pose error = (truth[i].inverse() * truth[j]).inverse() * (estimate[i].inverse() * estimate[j]);
    sum += 100.0 * error.translation().norm() / (way[j] - way[i]);
    ++count;
  }
  return count > 0 ? sum / count : std::nan("");
}

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0.0 : values[std::min(values.size() - 1, static_cast<std::size_t>(share * values.size()))];
}

struct Figures {
  std::vector<Pose> truth, estimate;
  std::vector<double> ms, nees;
  double solves = 0.0, most_solves = 0.0, lateral = 0.0, vertical = 0.0, yaw = 0.0, tilt = 0.0, axial = 0.0;
  std::size_t from = 0;
  int flagged = 0, flagged_rotation = 0, count = 0, unregistered = 0, capped = 0;
  Vector6d axis_nees = Vector6d::Zero(), axis_variance = Vector6d::Zero(),
           alone_nees = Vector6d::Zero();  // sums over fully observed sweeps
  int axis_count = 0;
};

void note(Figures& f, const Estimate& e, const Pose& truth, double ms, bool print) {
  const Pose first = f.truth.empty() ? truth : f.truth.front();
  f.truth.push_back(truth);
  f.estimate.push_back(e.pose);
  f.ms.push_back(ms);
  if (f.truth.size() == 1) return;
  const std::size_t n = f.truth.size();
  const Vector6d step = se3_log((f.truth[n - 2].inverse() * truth).inverse() * (f.estimate[n - 2].inverse() * e.pose));
  const Pose total = (first.inverse() * truth).inverse() * (f.estimate.front().inverse() * e.pose);
  if (n <= f.from) return;
  ++f.count;
  f.solves += e.scan.solves;
  f.most_solves = std::max<double>(f.most_solves, e.scan.solves);
  f.capped += e.scan.iteration_cap ? 1 : 0;
  if (!registered(e.status)) ++f.unregistered;
  f.flagged += e.localizability.translation[0].observable ? 0 : 1;
  f.flagged_rotation += e.localizability.rotation[0].observable ? 0 : 1;
  const int seen = 6 - e.localizability.unobservable();
  if (registered(e.status) && seen > 0) f.nees.push_back(step.dot(e.information * step) / seen);
  if (registered(e.status) && seen == 6) {
    // Where the match alone would be: what held it back was the prior.
    const Vector6d alone =
        se3_log(se3_exp(step) * se3_exp(-(e.information.ldlt().solve(Matrix6d::Identity()) * e.gradient)));
    f.alone_nees += alone.cwiseAbs2().cwiseQuotient(e.covariance.diagonal());
    f.axis_nees += step.cwiseAbs2().cwiseQuotient(e.covariance.diagonal());
    f.axis_variance += e.covariance.diagonal();
    ++f.axis_count;
  }
  const Eigen::Vector3d angles = degrees * so3_log(total.linear());
  f.axial = std::max(f.axial, std::abs(total.translation().x()));
  f.lateral = std::max(f.lateral, std::abs(total.translation().y()));
  f.vertical = std::max(f.vertical, std::abs(total.translation().z()));
  f.yaw = std::max(f.yaw, std::abs(angles.z()));
  f.tilt = std::max(f.tilt, angles.head<2>().norm());
  if (!print) return;
  const auto& t = e.localizability.translation;
  std::printf(
      "%4zu %-10s total %7.3f %7.3f %7.3f m %6.2f %6.2f %6.2f deg  step %5.1f %5.1f %5.1f mm %5.2f %5.2f %5.2f"
      "  weakest %5.2f %5.2f %5.2f s %.3f %.3f %.3f r %.4f  n %u m %u rms %.3f solves %u cells %u %.1f ms\n",
      n - 1, std::string(to_string(e.status)).c_str(), total.translation().x(), total.translation().y(),
      total.translation().z(), angles.x(), angles.y(), angles.z(), 1e3 * step[0], 1e3 * step[1], 1e3 * step[2],
      degrees * step[3], degrees * step[4], degrees * step[5], t[0].axis.x(), t[0].axis.y(), t[0].axis.z(), t[0].sigma,
      t[1].sigma, t[2].sigma, e.localizability.rotation[0].sigma, e.scan.registered, e.scan.matched,
      e.scan.rms_residual, e.scan.solves, e.scan.map_cells, ms);
}

void print(const Figures& f) {
  double way = 0.0;
  for (std::size_t i = 1; i < f.truth.size(); ++i) {
    way += (f.truth[i].translation() - f.truth[i - 1].translation()).norm();
  }
  const TrajectoryError e = trajectory_error(f.truth, f.estimate);
  const double n = std::max(1, f.count);
  double mean_nees = 0.0;
  for (const double v : f.nees) mean_nees += v / static_cast<double>(std::max<std::size_t>(1, f.nees.size()));
  std::printf("way %.1f m  end %.3f m = %.2f %%  t100 %.2f %%  t10 %.2f %%  ATE %.3f m\n", way, e.end, e.end_percent,
              piecewise(f.truth, f.estimate, 100.0), piecewise(f.truth, f.estimate, 10.0), e.ate);
  std::printf("largest error: axial %.3f lateral %.3f vertical %.3f m, yaw %.2f tilt %.2f deg\n", f.axial, f.lateral,
              f.vertical, f.yaw, f.tilt);
  std::printf(
      "flagged %.1f %% (rotation %.1f %%)  not registered %d  NEES per observed direction mean %.2f median %.2f\n",
      100.0 * f.flagged / n, 100.0 * f.flagged_rotation / n, f.unregistered, mean_nees, quantile(f.nees, 0.5));
  if (f.axis_count > 0) {
    const double m = f.axis_count;
    std::printf("by axis, x y z roll pitch yaw: NEES");
    for (const double v : f.axis_nees) std::printf(" %.2f", v / m);
    std::printf("; of the match alone");
    for (const double v : f.alone_nees) std::printf(" %.2f", v / m);
    std::printf("; claimed sigma [mm, mdeg]");
    for (int i = 0; i < 6; ++i) std::printf(" %.1f", 1e3 * (i < 3 ? 1.0 : degrees) * std::sqrt(f.axis_variance[i] / m));
    std::printf("\n");
  }
  std::printf("CPU ms median %.1f p95 %.1f max %.1f  solves mean %.1f max %.0f, at the cap %d\n", quantile(f.ms, 0.5),
              quantile(f.ms, 0.95), quantile(f.ms, 1.0), f.solves / n, f.most_solves, f.capped);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 1;
  const std::string folder = argv[1];
  std::map<std::string, std::string> options;
  for (int i = 2; i < argc; ++i) {
    const std::string text = argv[i];
    const std::size_t equals = text.find('=');
    options[text.substr(0, equals)] = equals == std::string::npos ? "1" : text.substr(equals + 1);
  }
  const auto number = [&](const char* name, double otherwise) {
    return options.count(name) > 0 ? std::atof(options[name].c_str()) : otherwise;
  };
  Config config;
  config.mode = mode_from_string(options["mode"]).value_or(Mode::default_);
  config.max_range = number("max_range", config.max_range);
  config.threads = static_cast<int>(number("threads", 1));
  SurfelConfig& c = config.surfel;
  for (const auto& [name, value] :
       std::initializer_list<std::pair<const char*, double*>>{{"selection_cell", &c.selection_cell},
                                                              {"max_extent", &c.max_extent},
                                                              {"min_width", &c.min_width},
                                                              {"planarity", &c.planarity},
                                                              {"max_thickness", &c.max_thickness},
                                                              {"cell_size", &c.cell_size},
                                                              {"residual_sigma", &c.residual_sigma},
                                                              {"common_tilt", &c.common_tilt},
                                                              {"range_sigma", &c.range_sigma},
                                                              {"max_acceleration", &c.max_acceleration},
                                                              {"deskew_share", &c.deskew_share},
                                                              {"max_angular_acceleration", &c.max_angular_acceleration},
                                                              {"map_radius", &c.map_radius}}) {
    *value = number(name, *value);
  }
  const double prior_percent = number("prior", std::nan(""));
  const auto every = static_cast<std::size_t>(number("every", 20));
  const auto first = static_cast<std::size_t>(number("first", 0));
  const auto scans = static_cast<std::size_t>(number("scans", 1e9));
  const Result<Trajectory> truth = read_tum(folder + "/gt_end.tum");
  if (!truth) {
    std::fprintf(stderr, "%s\n", truth.error().message.c_str());
    return 1;
  }
  LidarOdometry odometry(config);
  const bool with_imu = number("imu", 0.0) != 0.0;
  InertialConfig inertial;
  inertial.lidar_from_imu = read_extrinsic(folder, "T_base_lidar").inverse() * read_extrinsic(folder, "T_base_imu");
  InertialPredictor predictor(inertial);
  const std::vector<InertialSample> samples = with_imu ? read_imu(folder) : std::vector<InertialSample>();
  std::size_t next_sample = 0;
  Figures figures;
  figures.from = static_cast<std::size_t>(number("from", 0.0));
  Trajectory out;
  SweepReader reader(folder);
  for (std::size_t i = 0; i < truth->size() && i < first + scans; ++i) {
    std::optional<RecordedSweep> sweep = reader.next();
    if (!sweep) break;
    if (i < first) continue;
    const std::size_t rows = sweep->rings.empty() ? 1 : 128;
    if (number("organised", 1.0) != 0.0 && rows > 1) sweep = organised(*sweep, rows, 1024, 0.1);
    if (i == first + 20 || i == first + 100) std::printf("sweep %zu: resident %.1f MB\n", i, resident_megabytes());
    Prior prior;
    if (i > first) {
      Vector6d wheel = se3_log((*truth)[i - 1].pose.inverse() * (*truth)[i].pose);
      wheel[0] *= 1.0 + 0.01 * prior_percent;
      prior.pose = se3_exp(wheel);
      const double sigma = 0.015 * std::abs(wheel[0]) + 0.003;
      prior.information.diagonal() << 1.0 / (sigma * sigma), 1e4, 1e4, 2.5e5, 2.5e5, 2.5e5;
    }
    const std::clock_t begin = std::clock();
    const Prior* used = std::isnan(prior_percent) || i == first ? nullptr : &prior;
    std::optional<Prior> predicted;
    if (with_imu) {
      const SweepStamps stamps = odometry.stamps(sweep->cloud());
      while (next_sample < samples.size() && samples[next_sample].stamp_ns <= stamps.last_ns) {
        predictor.add(samples[next_sample++]);
      }
      predicted = predictor.predict(stamps);
      if (predicted) used = &*predicted;
    }
    const Estimate& e = odometry.process(sweep->cloud(), used);
    if (with_imu) predictor.correct(e);
    const double ms = 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    note(figures, e, (*truth)[i].pose, ms, every > 0 && (i - first) % every == 0);
    out.push_back({e.stamp_ns, e.pose});
  }
  print(figures);
  std::printf("at the end: resident %.1f MB\n", resident_megabytes());
  if (with_imu) {
    const InertialCounters& n = predictor.counters();
    std::printf("IMU: %lu samples, %lu refused; %lu sweeps predicted, %lu not covered, %lu contradicted\n", n.samples,
                n.refused, n.predicted, n.uncovered, n.contradicted);
  }
  if (options.count("tum") > 0) {
    if (const Result<void> written = write_tum(options["tum"], out); !written) return 1;
  }
  return 0;
}
