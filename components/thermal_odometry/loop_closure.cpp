#include "components/thermal_odometry/loop_closure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <opencv2/calib3d.hpp>

namespace adit::thermal_odometry {
namespace {

struct Match {
  std::size_t old;
  std::size_t now;
};

// Nearest, clearly nearer than the second, and nearest in return; only corners of the old view with depth.
std::vector<Match> match(std::span<const Corner> old_corners, std::span<const Descriptor> old_descriptors,
                         std::span<const Descriptor> now_descriptors, int max_distance, double ratio) {
  std::vector<std::pair<int, std::size_t>> nearest_old(now_descriptors.size(), {std::numeric_limits<int>::max(), 0});
  std::vector<Match> matches;
  for (std::size_t o = 0; o < old_descriptors.size(); ++o) {
    if (!(old_corners[o].depth > 0.0F)) continue;
    int best = std::numeric_limits<int>::max();
    int second = best;
    std::size_t at = 0;
    for (std::size_t n = 0; n < now_descriptors.size(); ++n) {
      const int distance = hamming(old_descriptors[o], now_descriptors[n]);
      if (distance < nearest_old[n].first) nearest_old[n] = {distance, o};
      if (distance < best) {
        second = best;
        best = distance;
        at = n;
      } else {
        second = std::min(second, distance);
      }
    }
    if (best <= max_distance && best < ratio * second) matches.push_back({o, at});
  }
  std::erase_if(matches, [&](const Match& m) { return nearest_old[m.now].second != m.old; });
  return matches;
}

Pose pose_of(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  const Eigen::Vector3d r(rotation_vector.at<double>(0), rotation_vector.at<double>(1), rotation_vector.at<double>(2));
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp(r);
  pose.translation() = Eigen::Vector3d(translation.at<double>(0), translation.at<double>(1), translation.at<double>(2));
  return pose;
}

}  // namespace

LoopClosure::LoopClosure(const Pinhole& camera, const Config& config) : camera_(camera), config_(config) {}

const LoopClosure::Outcome& LoopClosure::add(const Pose& T_odom_camera, bool known, std::span<const Corner> corners,
                                             std::span<const Descriptor> descriptors) {
  outcome_ = {};
  if (!T_odom_camera.matrix().allFinite() || corners.size() != descriptors.size()) return outcome_;
  if (graph_.size() >= config_.max_keyframes) {
    outcome_.result = Result::full;
    ++counts_[static_cast<std::size_t>(outcome_.result)];
    return outcome_;
  }
  const double step = graph_.size() == 0 ? 0.0 : (T_odom_camera.translation() - last_.translation()).norm();
  path_ += step;
  outcome_.node = add_to_graph(T_odom_camera, known, step);
  Place place{
      outcome_.node, T_odom_camera, path_, {corners.begin(), corners.end()}, {descriptors.begin(), descriptors.end()}};
  if (outcome_.node > 0) look_for_loop(place);
  ++counts_[static_cast<std::size_t>(outcome_.result)];
  last_ = T_odom_camera;
  const bool connected = outcome_.node > 0 || graph_.size() == 1;
  if (!connected || outcome_.result == Result::closed) return outcome_;
  index_.add(place.descriptors);
  places_.push_back(std::move(place));
  return outcome_;
}

pose_graph::NodeId LoopClosure::add_to_graph(const Pose& T_odom_camera, bool known, double step) {
  const auto node = graph_.add_node(T_map_odom_ * T_odom_camera);
  if (!node || *node == 0) return 0;
  // A restart keeps the last pose as its first: somewhere near, but nobody measured it.
  constexpr double unknown_translation = 5.0;  // m
  constexpr double unknown_rotation = 0.2;
  constexpr double smallest_step = 0.1;  // m: turning on the spot drifts as well
  const double walk = std::sqrt(std::max(step, smallest_step));
  const double sigma_t = known ? config_.drift_translation * walk : unknown_translation;
  const double sigma_r = known ? config_.drift_rotation * walk : unknown_rotation;
  pose_graph::Edge edge;
  edge.from = *node - 1;
  edge.to = *node;
  edge.T_from_to = last_.inverse() * T_odom_camera;
  edge.information.setZero();
  edge.information.diagonal().head<3>().setConstant(1.0 / (sigma_t * sigma_t));
  edge.information.diagonal().tail<3>().setConstant(1.0 / (sigma_r * sigma_r));
  return graph_.add_edge(edge) ? *node : 0;
}

void LoopClosure::look_for_loop(const Place& place) {
  const auto old = std::find_if(places_.begin(), places_.end(),
                                [&](const Place& p) { return p.path > place.path - config_.min_path; });
  const auto end = static_cast<std::uint32_t>(old - places_.begin());
  // The candidate that got furthest says what came of this keyframe.
  for (const PlaceIndex::Votes& votes : index_.query(place.descriptors, end, config_.candidates)) {
    if (votes.count < config_.min_votes) break;
    Outcome before = outcome_;
    const Place& old_place = places_[votes.place];
    outcome_.from = old_place.node;
    outcome_.votes = votes.count;
    outcome_.result = examine(old_place, place);
    if (outcome_.result == Result::closed) return;
    if (before.result > outcome_.result) outcome_ = before;
  }
}

LoopClosure::Result LoopClosure::examine(const Place& old, const Place& place) {
  if (config_.gate && !within_reach(old.node)) return Result::out_of_reach;
  const std::optional<Motion> motion = verify(old, place);
  if (!motion) return Result::not_verified;
  outcome_.inliers = motion->inliers;
  pose_graph::Edge& edge = outcome_.edge;
  edge.from = old.node;
  edge.to = outcome_.node;
  edge.T_from_to = motion->T_new_old.inverse();
  // The right increment of the inverse is the negative of the left increment of the motion: the same information.
  edge.information = motion->information;
  edge.kind = pose_graph::EdgeKind::loop;
  const auto agreement = graph_.check(edge);
  if (!agreement) return Result::not_verified;
  outcome_.chi_square = agreement->chi_square;
  if (config_.gate && !agreement->plausible) return Result::refused;
  if (!graph_.add_edge(edge)) return Result::not_verified;
  graph_.solve();
  T_map_odom_ = graph_.pose(outcome_.node) * place.T_odom_camera.inverse();
  return Result::closed;
}

bool LoopClosure::within_reach(pose_graph::NodeId from) const {
  const auto relative = graph_.relative(from, outcome_.node);
  if (!relative) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(relative->covariance.topLeftCorner<3, 3>());
  const double sigma = std::sqrt(std::max(0.0, spread.eigenvalues()(2)));
  return relative->T_from_to.translation().norm() < config_.max_distance + 3.0 * sigma;
}

// Perspective from three points within RANSAC (its random numbers begin anew in each call), then least squares.
std::optional<LoopClosure::Motion> LoopClosure::verify(const Place& old, const Place& now) {
  const std::vector<Match> matches =
      match(old.corners, old.descriptors, now.descriptors, config_.max_hamming, config_.ratio);
  outcome_.matches = static_cast<int>(matches.size());
  if (outcome_.matches < config_.min_inliers) return std::nullopt;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const Match& m : matches) {
    const Corner& corner = old.corners[m.old];
    const double z = static_cast<double>(corner.depth);
    points.emplace_back((static_cast<double>(corner.u) - camera_.cx) / camera_.fx * z,
                        (static_cast<double>(corner.v) - camera_.cy) / camera_.fy * z, z);
    pixels.emplace_back(now.corners[m.now].u, now.corners[m.now].v);
  }
  const cv::Matx33d intrinsics(camera_.fx, 0, camera_.cx, 0, camera_.fy, camera_.cy, 0, 0, 1);
  cv::Mat rotation, translation;
  std::vector<int> inliers;
  constexpr int iterations = 200;
  constexpr double confidence = 0.999;
  try {
    const bool found =
        cv::solvePnPRansac(points, pixels, intrinsics, cv::noArray(), rotation, translation, false, iterations,
                           static_cast<float>(config_.max_reprojection), confidence, inliers, cv::SOLVEPNP_P3P);
    if (!found || static_cast<int>(inliers.size()) < config_.min_inliers) return std::nullopt;
    std::vector<cv::Point3d> inlier_points;
    std::vector<cv::Point2d> inlier_pixels;
    for (const int i : inliers) {
      inlier_points.push_back(points[static_cast<std::size_t>(i)]);
      inlier_pixels.push_back(pixels[static_cast<std::size_t>(i)]);
    }
    cv::solvePnPRefineLM(inlier_points, inlier_pixels, intrinsics, cv::noArray(), rotation, translation);
  } catch (const cv::Exception&) {
    return std::nullopt;  // degenerate sets of points
  }

  Motion motion{pose_of(rotation, translation), Matrix6d::Zero(), static_cast<int>(inliers.size())};
  if (!motion.T_new_old.matrix().allFinite()) return std::nullopt;
  for (const int i : inliers) {
    const cv::Point3d& p = points[static_cast<std::size_t>(i)];
    const Eigen::Vector3d X = motion.T_new_old * Eigen::Vector3d(p.x, p.y, p.z);
    if (!(X.z() > 0.1)) return std::nullopt;
    Eigen::Matrix<double, 2, 3> projection;
    projection << camera_.fx / X.z(), 0, -camera_.fx * X.x() / (X.z() * X.z()), 0, camera_.fy / X.z(),
        -camera_.fy * X.y() / (X.z() * X.z());
    Eigen::Matrix<double, 3, 6> increment;  // left, [translation, rotation]
    increment << Eigen::Matrix3d::Identity(), -skew(X);
    const Eigen::Matrix<double, 2, 6> J = projection * increment;
    motion.information += J.transpose() * J / (config_.pixel_sigma * config_.pixel_sigma);
  }
  const Eigen::LDLT<Matrix6d> solver(motion.information);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return std::nullopt;
  Matrix6d covariance = solver.solve(Matrix6d::Identity());
  covariance.diagonal().head<3>().array() += config_.translation_floor * config_.translation_floor;
  covariance.diagonal().tail<3>().array() += config_.rotation_floor * config_.rotation_floor;
  if (!covariance.allFinite()) return std::nullopt;
  const Matrix6d information = covariance.ldlt().solve(Matrix6d::Identity());
  motion.information = 0.5 * (information + information.transpose());
  return motion;
}

}  // namespace adit::thermal_odometry
