#include "components/mapping/loop_detector.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Eigenvalues>

namespace adit::mapping {
namespace {

using pose_graph::NodeId;

// How much of the surroundings of a keyframe a cloud is registered to: so many keyframes to each side.
constexpr NodeId neighbours = 2;
constexpr double coarse_voxel = 1.2, fine_voxel = 0.5;  // m, of the planes
constexpr double coarse_kernel = 0.8, fine_kernel = 0.12;
// A second closure confirms a first one if they differ by less than this, and this part of the way between.
constexpr double same_m = 0.3, same_rad = 0.02, same_share = 0.02;
constexpr double confirmation_way = 80.0;  // m: an unconfirmed closure is forgotten then
// A place recognized by its sections is known to about this: 1 m, sideways 2 m, 0.2 rad.
const Vector6d recognition_sigma = (Vector6d() << 1.0, 2.0, 2.0, 0.2, 0.2, 0.2).finished();

}  // namespace

pose_graph::Edge edge_of(const Closure& closure) {
  return {.from = closure.from,
          .to = closure.to,
          .T_from_to = closure.registration.pose,
          .information = with_floor(closure.registration.information),
          .kind = pose_graph::EdgeKind::loop};
}

std::optional<NodeId> LoopDetector::nearest_old(NodeId i) const {
  std::optional<NodeId> nearest;
  double least = std::numeric_limits<double>::infinity();
  const Eigen::Vector3d here = drive_.graph.pose(i).translation();
  for (NodeId j = 0; j < i; ++j) {
    const Keyframe& old = drive_.keyframes[j];
    if (drive_.keyframes[i].way - old.way < config_.revisit_gap) break;
    if (old.points.empty()) continue;
    const double distance = (drive_.graph.pose(j).translation() - here).norm();
    if (distance < least) {
      least = distance;
      nearest = j;
    }
  }
  return nearest;
}

std::pair<NodeId, Pose> LoopDetector::place_of(std::size_t section) const {
  const auto after = std::upper_bound(drive_.keyframes.begin(), drive_.keyframes.end(), section,
                                      [](std::size_t s, const Keyframe& k) { return s < k.sections_end; });
  const auto id = static_cast<NodeId>(
      std::min(after - drive_.keyframes.begin(), static_cast<std::ptrdiff_t>(drive_.keyframes.size()) - 1));
  if (id == 0) return {0, Pose::Identity()};
  const Keyframe& from = drive_.keyframes[id - 1];
  const Keyframe& to = drive_.keyframes[id];
  const auto count = static_cast<double>(to.sections_end - from.sections_end);
  const double fraction = (static_cast<double>(section - from.sections_end) + 0.5) / std::max(1.0, count);
  return {id, to.odom.inverse() * se3_interpolate(from.odom, to.odom, fraction) * along_the_way(to)};
}

LoopDetector::Candidate LoopDetector::candidate_of(const SectionMatch& match, NodeId i) const {
  constexpr std::size_t averaged = 20;  // sections for the sideways offset: 10 m
  const std::span<const Section> sections = drive_.sections.sections();
  const std::size_t end = drive_.keyframes[i].sections_end - 1;
  const std::size_t first = match.reversed ? match.end : match.end + 1 - averaged;
  const Eigen::Vector2d sideways =
      offset_between(sections.subspan(end + 1 - averaged, averaged), sections.subspan(first, averaged), match.reversed);
  const auto [keyframe, T_keyframe_section] = place_of(match.end);
  const Pose T_i_end = place_of(end).second;
  Pose across(Eigen::Translation3d(0.0, sideways.x(), sideways.y()));
  if (match.reversed) across.rotate(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()));
  return {keyframe, T_keyframe_section * across * T_i_end.inverse(), true};
}

bool LoopDetector::possible(const Candidate& candidate, NodeId i) const {
  const Matrix6d information = recognition_sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  const Result<pose_graph::Agreement> agreement = drive_.graph.check({.from = candidate.keyframe,
                                                                      .to = i,
                                                                      .T_from_to = candidate.guess,
                                                                      .information = information,
                                                                      .kind = pose_graph::EdgeKind::loop});
  return agreement && agreement->plausible;
}

std::optional<LoopDetector::Candidate> LoopDetector::recognize(NodeId i) const {
  constexpr std::size_t looked_at = 6;  // peaks
  const Keyframe& here = drive_.keyframes[i];
  if (here.sections_end == 0) return std::nullopt;
  const auto old = std::partition_point(drive_.keyframes.begin(), drive_.keyframes.end(),
                                        [&](const Keyframe& k) { return here.way - k.way >= config_.revisit_gap; });
  if (old == drive_.keyframes.begin()) return std::nullopt;
  const std::vector<SectionMatch> peaks =
      drive_.sections.search(here.sections_end - 1, std::prev(old)->sections_end, looked_at);
  std::optional<Candidate> best;
  double best_score = 0.0;
  for (const SectionMatch& peak : peaks) {
    if (best ? peak.score < config_.rival_share * best_score : peak.score < config_.least_score) break;
    const Candidate candidate = candidate_of(peak, i);
    if (!possible(candidate, i)) continue;
    if (!best) {
      best = candidate;
      best_score = peak.score;
      continue;
    }
    // The same place met on another lap is no rival.
    const Pose a = drive_.graph.pose(best->keyframe) * best->guess;
    const Pose b = drive_.graph.pose(candidate.keyframe) * candidate.guess;
    if ((a.translation() - b.translation()).norm() > config_.sure_radius + same_m) return std::nullopt;
  }
  return best;
}

Registration LoopDetector::registered(const Candidate& candidate, NodeId i) const {
  const NodeId first = candidate.keyframe > neighbours ? candidate.keyframe - neighbours : 0;
  const NodeId last = std::min<NodeId>(candidate.keyframe + neighbours, i - 1);
  const Pose back = drive_.graph.pose(candidate.keyframe).inverse();
  Points around;
  for (NodeId j = first; j <= last; ++j) {
    const Eigen::Isometry3f motion = (back * drive_.graph.pose(j)).cast<float>();
    for (const Point& point : drive_.keyframes[j].points) around.push_back({motion * point.position, point.intensity});
  }
  const Points& cloud = drive_.keyframes[i].points;
  RegistrationConfig config;
  config.kernel = coarse_kernel;
  const Registration coarse = align(cloud, PlaneMap(around, coarse_voxel), candidate.guess, config);
  config.kernel = fine_kernel;
  return align(cloud, PlaneMap(around, fine_voxel), coarse.pose, config);
}

std::optional<double> LoopDetector::agreement(NodeId from, NodeId i, const Pose& T_from_i) const {
  const Keyframe& here = drive_.keyframes[i];
  if (here.sections_end == 0) return std::nullopt;
  const std::size_t end = here.sections_end - 1;
  const Pose place = T_from_i * place_of(end).second;
  // The section beside it on the old way.
  const NodeId first = from > neighbours ? from - neighbours : 0;
  const NodeId last = std::min<NodeId>(from + neighbours, i - 1);
  const Pose back = drive_.graph.pose(from).inverse();
  std::optional<std::size_t> beside;
  double least = std::numeric_limits<double>::infinity();
  bool reversed = false;
  for (std::size_t s = drive_.keyframes[first].sections_end; s < drive_.keyframes[last].sections_end; ++s) {
    const auto [keyframe, T_keyframe_section] = place_of(s);
    const Pose at = back * drive_.graph.pose(keyframe) * T_keyframe_section;
    const double distance = (at.translation() - place.translation()).norm();
    if (distance < least) {
      least = distance;
      beside = s;
      reversed = at.linear().col(0).dot(place.linear().col(0)) < 0.0;
    }
  }
  if (!beside) return std::nullopt;
  std::optional<double> best;
  for (std::size_t s = *beside > 0 ? *beside - 1 : 0; s <= *beside + 1; ++s) {
    const std::optional<double> score = drive_.sections.correlate(end, s, reversed);
    if (score && (!best || *score > *best)) best = score;
  }
  return best;
}

bool LoopDetector::agree(const Closure& a, const Closure& b) const {
  const pose_graph::PoseGraph& graph = drive_.graph;
  const Pose expected = graph.pose(b.from).inverse() * graph.pose(a.from) * a.registration.pose *
                        graph.pose(a.to).inverse() * graph.pose(b.to);
  const Pose error = expected.inverse() * b.registration.pose;
  const double way = std::abs(drive_.keyframes[a.to].way - drive_.keyframes[b.to].way);
  return error.translation().norm() < same_m + same_share * way && so3_log(error.linear()).norm() < same_rad;
}

Attempt LoopDetector::examine(NodeId i, std::vector<Closure>& accepted) {
  const std::optional<NodeId> nearest = nearest_old(i);
  if (!nearest || drive_.keyframes[i].points.empty()) return {};
  const Result<pose_graph::Relative> known = drive_.graph.relative(*nearest, i);
  if (!known) return {};
  const Eigen::Matrix3d spread = known->covariance.topLeftCorner<3, 3>();
  const double three_sigma =
      3.0 * std::sqrt(std::max(0.0, spread.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()));
  const double distance = known->T_from_to.translation().norm();
  if (distance > config_.reach + three_sigma) return {};

  Attempt attempt;
  attempt.outcome = Outcome::unrecognized;
  std::optional<Candidate> candidate;
  if (three_sigma <= config_.sure_radius) {
    candidate = Candidate{*nearest, known->T_from_to, false};
  } else {
    candidate = recognize(i);
  }
  if (!candidate) return attempt;

  attempt.outcome = Outcome::not_registered;
  Closure& closure = attempt.closure;
  closure.from = candidate->keyframe;
  closure.to = i;
  closure.recognized = candidate->recognized;
  closure.registration = registered(*candidate, i);
  const Registration& r = closure.registration;
  if (!r.converged || r.overlap < config_.least_overlap || r.rms > config_.most_rms) return attempt;
  if (closure.recognized && r.weakest_sigma > config_.most_axial_sigma) return attempt;

  attempt.outcome = Outcome::disagreed;
  const std::optional<double> score = agreement(closure.from, i, r.pose);
  closure.score = score.value_or(0.0);
  if (score ? *score < config_.least_agreement : closure.recognized) return attempt;
  const Result<pose_graph::Agreement> fits = drive_.graph.check(edge_of(closure));
  if (!fits) return attempt;
  attempt.chi_square = fits->chi_square;
  if (!fits->plausible) return attempt;

  if (!closure.recognized) {
    accepted.push_back(closure);
    attempt.outcome = Outcome::closed;
    return attempt;
  }
  attempt.outcome = confirm(closure, accepted);
  return attempt;
}

Outcome LoopDetector::confirm(const Closure& closure, std::vector<Closure>& accepted) {
  const double way = drive_.keyframes[closure.to].way;
  std::erase_if(unconfirmed_, [&](const Closure& c) { return way - drive_.keyframes[c.to].way > confirmation_way; });
  const auto second = std::find_if(unconfirmed_.begin(), unconfirmed_.end(), [&](const Closure& c) {
    return way - drive_.keyframes[c.to].way >= config_.closure_distance && agree(c, closure);
  });
  if (second == unconfirmed_.end()) {
    unconfirmed_.push_back(closure);
    return Outcome::unconfirmed;
  }
  accepted.push_back(*second);
  accepted.push_back(closure);
  unconfirmed_.clear();
  return Outcome::closed;
}

}  // namespace adit::mapping
