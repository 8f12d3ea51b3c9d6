#include "bringup/evaluation/consistency.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <Eigen/Cholesky>

namespace adit::evaluation {
namespace {

// "1000.010000000" without losing nanoseconds in a double.
bool parse_stamp(const std::string& text, std::int64_t& stamp_ns) {
  const std::size_t dot = text.find('.');
  if (dot == std::string::npos || text.size() != dot + 10) return false;
  if (!std::all_of(text.begin(), text.end(), [](char c) { return c == '.' || (c >= '0' && c <= '9'); })) return false;
  if (dot == 0 || dot > 11) return false;
  stamp_ns = std::stoll(text.substr(0, dot)) * 1'000'000'000 + std::stoll(text.substr(dot + 1));
  return true;
}

}  // namespace

Result<std::vector<StampedCovariance>> read_covariances(const std::string& path) {
  std::ifstream file(path);
  if (!file) return Error{ErrorCode::not_found, path + ": cannot read"};
  std::vector<StampedCovariance> covariances;
  std::string stamp, line;
  for (int number = 1; file >> stamp; ++number) {
    if (stamp.starts_with('#')) {
      std::getline(file, line);
      continue;
    }
    StampedCovariance c;
    double v[6];
    for (double& value : v) file >> value;
    const bool fine = !file.fail() && std::all_of(v, v + 6, [](double value) { return std::isfinite(value); });
    if (!fine || !parse_stamp(stamp, c.stamp_ns)) {
      return Error{ErrorCode::malformed, path + ":" + std::to_string(number) + ": expected a stamp and six numbers"};
    }
    c.covariance << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
    covariances.push_back(c);
  }
  return covariances;
}

void add_consistency(std::span<const StampedCovariance> covariances, Evaluation& evaluation) {
  evaluation.nees.clear();
  evaluation.nees_mean = evaluation.sigma3_coverage = std::nullopt;
  if (evaluation.samples.empty()) return;
  double sum = 0.0;
  std::size_t covered = 0;
  auto c = covariances.begin();
  for (const Sample& s : evaluation.samples) {
    while (c != covariances.end() && c->stamp_ns < s.stamp_ns) ++c;
    if (c == covariances.end()) break;
    if (c->stamp_ns != s.stamp_ns) continue;
    // The estimate's own axes are the truth's, turned by what aligned the first poses.
    const double turn = evaluation.alignment_yaw_rad;
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
    axes.topLeftCorner<2, 2>() << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
    const Eigen::Matrix3d p = axes * c->covariance * axes.transpose();
    const Eigen::LDLT<Eigen::Matrix3d> factor(p);
    if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 1e-18)) continue;
    const Eigen::Vector2d shift = (s.start_aligned - s.truth.translation()).head<2>();
    const Eigen::Vector3d error(shift.x(), shift.y(), s.start_yaw_error_rad);
    const double nees = error.dot(factor.solve(error));
    const double heading = yaw(s.truth.linear());
    const Eigen::Vector2d ahead(std::cos(heading), std::sin(heading));
    const double sigma = std::sqrt(ahead.dot(p.topLeftCorner<2, 2>() * ahead));
    covered += std::abs(ahead.dot(shift)) <= 3.0 * sigma ? 1 : 0;
    sum += nees;
    evaluation.nees.push_back({s.stamp_ns, nees});
  }
  if (evaluation.nees.empty()) return;
  const auto n = static_cast<double>(evaluation.nees.size());
  evaluation.nees_mean = sum / n;
  evaluation.sigma3_coverage = static_cast<double>(covered) / n;
}

}  // namespace adit::evaluation
