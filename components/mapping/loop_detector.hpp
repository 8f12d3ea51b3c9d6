// Which earlier keyframe a keyframe meets again, if any: conditions 1 to 5 of mapper.hpp.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "components/mapping/mapper.hpp"

namespace adit::mapping {

// What a drive has left so far; node i of the graph is keyframe i.
struct Drive {
  std::vector<Keyframe> keyframes;
  SectionHistory sections;
  pose_graph::PoseGraph graph;
};

pose_graph::Edge edge_of(const Closure& closure);

class LoopDetector {
 public:
  LoopDetector(const Config& config, const Drive& drive) : config_(config), drive_(drive) {}

  // Precondition: the sections up to keyframe i are ready. Appends what is to be taken to `accepted`.
  Attempt examine(pose_graph::NodeId i, std::vector<Closure>& accepted);

 private:
  struct Candidate {
    pose_graph::NodeId keyframe = 0;
    Pose guess = Pose::Identity();  // T_keyframe_i
    bool recognized = false;
  };
  std::optional<pose_graph::NodeId> nearest_old(pose_graph::NodeId i) const;
  std::optional<Candidate> recognize(pose_graph::NodeId i) const;
  // Keyframe and T_keyframe_section, which looks along the way.
  std::pair<pose_graph::NodeId, Pose> place_of(std::size_t section) const;
  Candidate candidate_of(const SectionMatch& match, pose_graph::NodeId i) const;
  bool possible(const Candidate& candidate, pose_graph::NodeId i) const;
  Registration registered(const Candidate& candidate, pose_graph::NodeId i) const;
  // Correlation of the sections where a registration puts keyframe i.
  std::optional<double> agreement(pose_graph::NodeId from, pose_graph::NodeId i, const Pose& T_from_i) const;
  bool agree(const Closure& a, const Closure& b) const;
  Outcome confirm(const Closure& closure, std::vector<Closure>& accepted);

  const Config& config_;
  const Drive& drive_;
  std::vector<Closure> unconfirmed_;
};

}  // namespace adit::mapping
