// Mapping over a folder of the tunnel simulator (`adit simulate`) with the odometry of `adit odometry lidar`; prints
// what was closed against the truth; a study, no test.
//   mapping_study FOLDER ODOMETRY.tum [every=1] [scale=1] [yaw=0] [model_m] [model_rad] [print=0] [from=0] [scans=N]
// every: uses each n-th sweep. scale, yaw [rad/m]: error added to the odometry. model_*: of the mapper's drift model.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <string>

#include "components/dataset/dataset.hpp"
#include "components/dataset/point_file.hpp"
#include "components/mapping/mapper.hpp"

using namespace adit;
using namespace adit::mapping;

namespace {

constexpr double degrees = 57.29577951308232;

struct Options {
  std::map<std::string, std::string> values;
  double number(const std::string& key, double fallback) const {
    const auto entry = values.find(key);
    return entry == values.end() ? fallback : std::stod(entry->second);
  }
};

// The same motion with an error of its scale and heading: smooth in the small, far off after a lap.
Trajectory drifted(const Trajectory& odometry, double scale, double yaw_a_metre) {
  Trajectory out;
  for (std::size_t i = 0; i < odometry.size(); ++i) {
    if (i == 0) {
      out.push_back(odometry[0]);
      continue;
    }
    Pose step = odometry[i - 1].pose.inverse() * odometry[i].pose;
    const double way = step.translation().norm();
    step.translation() *= scale;
    step.linear() = step.linear() * so3_exp({0.0, 0.0, yaw_a_metre * way});
    out.push_back({odometry[i].stamp_ns, out.back().pose * step});
  }
  return out;
}

// Root mean square distance after the best rigid alignment, and the largest one.
std::pair<double, double> ate(const std::vector<Pose>& truth, const Trajectory& estimate) {
  const auto n = static_cast<Eigen::Index>(truth.size());
  Eigen::Matrix3Xd a(3, n), b(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    a.col(i) = estimate[static_cast<std::size_t>(i)].pose.translation();
    b.col(i) = truth[static_cast<std::size_t>(i)].translation();
  }
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, false);
  const Eigen::Matrix3Xd error = (m.topLeftCorner<3, 3>() * a).colwise() + m.topRightCorner<3, 1>() - b;
  return {std::sqrt(error.colwise().squaredNorm().mean()), error.colwise().norm().maxCoeff()};
}

double cpu_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

struct Recall {
  std::size_t revisits = 0, found = 0;
};

// A keyframe is a true revisit if an older one, so much way before, is within 5 m; it is found if a closure lies within
// the distance between attempts.
Recall recall(const std::vector<Pose>& truth, const std::vector<double>& way, const std::vector<Closure>& closures,
              const Config& config, bool print) {
  Recall out;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    bool revisit = false;
    for (std::size_t j = 0; j < i && way[i] - way[j] > config.revisit_gap && !revisit; ++j) {
      revisit = (truth[j].translation() - truth[i].translation()).norm() < 5.0;
    }
    if (!revisit) continue;
    ++out.revisits;
    const bool found = std::any_of(closures.begin(), closures.end(), [&](const Closure& c) {
      return std::abs(way[c.to] - way[i]) <= config.closure_distance + config.keyframes.distance;
    });
    out.found += found ? 1 : 0;
    if (!found && print)
      std::printf("missed: keyframe %zu at %.0f m, true %.0f %.0f\n", i, way[i], truth[i].translation().x(),
                  truth[i].translation().y());
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: mapping_study FOLDER ODOMETRY.tum [key=value ...]\n");
    return 2;
  }
  Options options;
  for (int i = 3; i < argc; ++i) {
    const std::string text = argv[i];
    options.values[text.substr(0, text.find('='))] = text.substr(text.find('=') + 1);
  }
  const std::string folder = argv[1];
  const auto dataset = dataset::open_dataset(folder, 10.0);
  const auto recorded = read_tum(argv[2]);
  const auto truth_end = read_tum(folder + "/gt_end.tum");
  if (!dataset || !recorded || !truth_end) {
    std::fprintf(stderr, "%s\n",
                 !dataset    ? dataset.error().message.c_str()
                 : !recorded ? recorded.error().message.c_str()
                             : truth_end.error().message.c_str());
    return 1;
  }
  const Trajectory odometry = drifted(*recorded, options.number("scale", 1), options.number("yaw", 0));
  Config config;
  config.least_score = options.number("least_score", config.least_score);
  config.rival_share = options.number("rival_share", config.rival_share);
  config.least_agreement = options.number("least_agreement", config.least_agreement);
  config.drift_translation = options.number("model_m", config.drift_translation);
  config.drift_rotation = options.number("model_rad", config.drift_rotation);
  Mapper mapper(config);
  const auto every = static_cast<std::size_t>(options.number("every", 1));
  const auto first = static_cast<std::size_t>(options.number("from", 0));
  const auto last = std::min(dataset->entries.size(), first + static_cast<std::size_t>(options.number("scans", 1e9)));
  const bool print = options.number("print", 0) > 0;

  std::map<std::int64_t, Pose> truth_at;  // by the end of the sweep
  std::vector<Point> points;
  std::vector<float> seconds;
  double cpu = 0.0, worst_cpu = 0.0;
  std::uint64_t attempts = 0;
  for (std::size_t n = first; n < last && n < truth_end->size(); n += every) {
    const auto file = dataset::read_bin(dataset->entries[n].path, dataset->entries[n].points);
    if (!file || file->fields.size() < 5) continue;
    const std::size_t columns = file->fields.size();
    points.resize(file->points);
    seconds.resize(file->points);
    for (std::size_t i = 0; i < file->points; ++i) {
      const float* row = &file->values[i * columns];
      points[i] = {{row[0], row[1], row[2]}, row[3]};
      seconds[i] = row[4];
    }
    const Sweep sweep{dataset->entries[n].stamp_ns, points, seconds};
    const double begin = cpu_seconds();
    const Mapper::Update update = mapper.add(sweep, odometry);
    const double spent = cpu_seconds() - begin;
    cpu += spent;
    worst_cpu = std::max(worst_cpu, spent);
    if (update.keyframe) truth_at[mapper.trajectory().back().stamp_ns] = (*truth_end)[n].pose;
    if (print && mapper.counters().attempts != attempts) {
      attempts = mapper.counters().attempts;
      const Attempt& attempt = mapper.last_attempt();
      const Closure& c = attempt.closure;
      const Registration& g = c.registration;
      static const char* names[] = {"nowhere", "unrecognized", "not_registered", "disagreed", "unconfirmed", "closed"};
      const Eigen::Vector3d at = (*truth_end)[n].pose.translation();
      std::printf("%s %u-%u %s score %.2f chi2 %.1f converged %d overlap %.2f rms %.3f weakest %.3f now %.0f %.0f\n",
                  names[static_cast<int>(attempt.outcome)], c.from, c.to, c.recognized ? "recognized" : "known",
                  c.score, attempt.chi_square, g.converged, g.overlap, g.rms, g.weakest_sigma, at.x(), at.y());
    }
  }
  const double finish_begin = cpu_seconds();
  mapper.finish();
  const double finish_cpu = cpu_seconds() - finish_begin;

  const Trajectory before = mapper.odometry(), after = mapper.trajectory();
  std::vector<Pose> truth;
  std::vector<double> way{0.0};
  for (const StampedPose& pose : after) {
    truth.push_back(truth_at.at(pose.stamp_ns));
    if (truth.size() > 1)
      way.push_back(way.back() + (truth.back().translation() - truth[truth.size() - 2].translation()).norm());
  }
  std::size_t wrong = 0;
  double worst_m = 0.0, worst_deg = 0.0, sum2 = 0.0;
  for (const Closure& c : mapper.closures()) {
    const Pose error = (truth[c.from].inverse() * truth[c.to]).inverse() * c.registration.pose;
    const double m = error.translation().norm(), deg = degrees * so3_log(error.linear()).norm();
    const bool is_wrong = m > 0.5 || deg > 2.0;
    if (is_wrong) ++wrong;
    if (is_wrong || print) {
      std::printf("%s %u-%u at %.0f m: error %.3f %.3f %.3f m %.2f deg, score %.2f weakest %.3f\n",
                  is_wrong ? "FALSE" : "true", c.from, c.to, way[c.to], error.translation().x(),
                  error.translation().y(), error.translation().z(), deg, c.score, c.registration.weakest_sigma);
    }
    worst_m = std::max(worst_m, m);
    worst_deg = std::max(worst_deg, deg);
    sum2 += m * m;
  }
  const Counters& k = mapper.counters();
  const Recall r = recall(truth, way, mapper.closures(), config, print);
  const auto [ate_before, max_before] = ate(truth, before);
  const auto [ate_after, max_after] = ate(truth, after);
  const auto n = static_cast<double>(std::max<std::size_t>(1, mapper.closures().size()));
  std::printf("way %.0f m, keyframes %zu, sweeps %lu (refused %lu)\n", way.back(), after.size(), k.sweeps,
              k.refused_sweeps);
  std::printf("attempts %lu: closures %lu, unrecognized %lu, not registered %lu, disagreed %lu, switched off %lu\n",
              k.attempts, k.closures, k.unrecognized, k.not_registered, k.disagreed, k.switched_off);
  std::printf("false closures %zu; error rms %.3f m, worst %.3f m %.2f deg\n", wrong, std::sqrt(sum2 / n), worst_m,
              worst_deg);
  std::printf("recall %zu of %zu = %.1f %%\n", r.found, r.revisits,
              100.0 * static_cast<double>(r.found) / static_cast<double>(std::max<std::size_t>(1, r.revisits)));
  std::printf("ATE before %.3f (max %.3f) m, after %.3f (max %.3f) m\n", ate_before, max_before, ate_after, max_after);
  std::printf("CPU %.2f ms a sweep, worst %.0f ms, at the end %.0f ms\n",
              1e3 * cpu / static_cast<double>(std::max<std::uint64_t>(1, k.sweeps + k.refused_sweeps)), 1e3 * worst_cpu,
              1e3 * finish_cpu);
  return 0;
}
