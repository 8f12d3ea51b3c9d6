// Places met again: recognized by their corners, verified with LiDAR depths, judged by what the odometry may have
// drifted since, and then an edge of a pose graph. The odometry's poses are not changed; the result is a correction,
// map <- odom (LDSO: Gao et al., IROS 2018, with SE(3) edges, because depths are metric).
//
// For drives that come back. A tunnel looks alike every few metres: there only the gate stands between an alias and the
// map, and the component has this off unless asked.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/pose_graph/pose_graph.hpp"
#include "components/thermal_odometry/camera.hpp"
#include "components/thermal_odometry/corners.hpp"

namespace adit::thermal_odometry {

class LoopClosure {
 public:
  struct Config {
    double min_path = 15.0;         // m driven since a place before it can be met again
    int min_votes = 20;             // corners that look like some of the place
    std::size_t candidates = 3;     // places looked at closer
    double max_distance = 12.0;     // m between two views that can be matched: farther is refused unseen
    int max_hamming = 50;           // bits, of a match; LDSO
    double ratio = 0.8;             // of a match to the second best
    double max_reprojection = 3.0;  // px, inlier
    int min_inliers = 15;
    double pixel_sigma = 1.5;  // px, of a corner found again
    // What a closure may be wrong by beyond its pixels: depth, calibration, rows read one after the other.
    double translation_floor = 0.03;  // m
    double rotation_floor = 0.003;    // rad
    // How the odometry drifts, as a random walk over the path: 0.5 m and 1 degree in 100 m, three times what it does.
    double drift_translation = 0.05;  // m per square root of a metre
    double drift_rotation = 0.0017;   // rad per square root of a metre
    bool gate = true;                 // off: for showing what it is good for
    // Of the pose graph, whose solution takes longer with each; no more are added then, and the correction stays. A
    // place takes 60 kB, a keyframe that met one again next to nothing.
    std::size_t max_keyframes = 3000;
  };
  LoopClosure(const Pinhole& camera, const Config& config);

  enum class Result : std::uint8_t {
    new_place,     // nothing like it before
    out_of_reach,  // something like it, but the odometry cannot be wrong by so much: not looked at
    not_verified,  // no rigid motion explains enough matches
    refused,       // a motion that the odometry contradicts by more than 3 sigma
    closed,
    full,  // max_keyframes: not looked at
  };
  struct Outcome {
    Result result = Result::new_place;
    pose_graph::NodeId node = 0;  // of this keyframe
    pose_graph::NodeId from = 0;  // the place, unless new_place
    int votes = 0;
    int matches = 0;
    int inliers = 0;
    double chi_square = 0.0;  // against the graph; 0 if it was not asked
    pose_graph::Edge edge{};  // if closed
  };
  // `known`: the motion since the last keyframe is measured (false after a restart of the odometry: that edge then
  // holds next to nothing). Corners and descriptors as of detect_corners. Milliseconds, and tens of them at a closure.
  const Outcome& add(const Pose& T_odom_camera, bool known, std::span<const Corner> corners,
                     std::span<const Descriptor> descriptors);

  // Coordinates of the odometry frame to those of the map, at the newest keyframe; identity before the first closure.
  const Pose& T_map_odom() const { return T_map_odom_; }
  const pose_graph::PoseGraph& graph() const { return graph_; }
  // Stored for recognition: a keyframe that met a place again is not stored beside it.
  std::size_t places() const { return places_.size(); }
  int count(Result result) const { return counts_[static_cast<std::size_t>(result)]; }

 private:
  struct Place {
    pose_graph::NodeId node = 0;
    Pose T_odom_camera;
    double path = 0.0;  // m
    std::vector<Corner> corners;
    std::vector<Descriptor> descriptors;
  };
  struct Motion {
    Pose T_new_old;
    Matrix6d information;
    int inliers = 0;
  };
  pose_graph::NodeId add_to_graph(const Pose& T_odom_camera, bool known, double step);
  void look_for_loop(const Place& place);
  Result examine(const Place& old, const Place& place);
  bool within_reach(pose_graph::NodeId from) const;
  std::optional<Motion> verify(const Place& old, const Place& now);

  Pinhole camera_;
  Config config_;
  pose_graph::PoseGraph graph_;
  PlaceIndex index_;
  std::vector<Place> places_;     // by the index's numbers
  Pose last_ = Pose::Identity();  // keyframe in the odometry frame
  double path_ = 0.0;             // m, to it
  Pose T_map_odom_ = Pose::Identity();
  Outcome outcome_;
  std::array<int, 6> counts_{};
};

}  // namespace adit::thermal_odometry
