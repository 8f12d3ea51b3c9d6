// Mapping: keyframes of the odometry, places met again, a pose graph over both; out of it map -> odom and the map.
// A plain library: no middleware, clock, logging or threads; one caller at a time; same input, same output. Bad input
// is counted and left out.
//
// A false closure is worse than none, and tunnels look alike. A closure is taken when
//   1. the graph's covariance makes the place possible (Mahalanobis distance below 3): where it knows the place to 2 m
//      (three sigma), the nearest keyframe is the candidate, elsewhere the sections must recognize it, and no other
//      possible place may look nearly as much alike;
//   2. the clouds register: overlap, residual, and the axis of the tunnel observed by more than noise;
//   3. the sections agree where the registration says they should (where there is anything to see);
//   4. the closure fits the graph (chi-square), and
//   5. if the graph did not know the place before, a second closure farther on says the same.
#pragma once

#include <memory>

#include "components/mapping/keyframes.hpp"
#include "components/mapping/registration.hpp"
#include "components/pose_graph/pose_graph.hpp"

namespace adit::mapping {

struct Config {
  KeyframeBuilder::Config keyframes;
  SectionHistory::Config sections;
  // Random walk of the odometry that makes the edges' covariance: one sigma of a way of 1 m; of d m: times sqrt(d).
  double drift_translation = 0.02;  // m
  double drift_rotation = 0.00035;  // rad
  double unobserved_drift = 0.1;    // part of the way, along an axis that the odometry did not observe
  double revisit_gap = 60.0;        // m driven in between: less is no revisit
  double closure_distance = 8.0;    // m between attempts
  double reach = 8.0;               // m: farther off is another place
  double sure_radius = 2.0;         // m, three sigma: the graph knows the place well enough to register at once
  double least_score = 0.35;        // of the sections' correlation, to be recognized
  double rival_share = 0.8;         // of the best score that no other possible place may reach
  double least_agreement = 0.25;    // of the correlation at the registered place
  double least_overlap = 0.7;
  double most_rms = 0.06;            // m: clouds that a rough odometry smeared do not fit better
  double most_axial_sigma = 0.15;    // m: weakest direction of a closure that is to make a place known
  std::size_t max_keyframes = 4000;  // then no more are taken: 16 km, about 500 MB
};

struct Closure {
  pose_graph::NodeId from = 0, to = 0;  // keyframes, the older one first
  Registration registration;
  double score = 0.0;       // correlation of the sections there; 0: no contrast
  bool recognized = false;  // by its sections, not by the graph's knowledge
};

// What became of a keyframe that was examined.
enum class Outcome : std::uint8_t {
  nowhere_near,    // the graph knows it as a new place
  unrecognized,    // it may be an old one, but none stands out
  not_registered,  // condition 2
  disagreed,       // conditions 3 and 4
  unconfirmed,     // condition 5: waits for a second one
  closed,
};

struct Attempt {
  Outcome outcome = Outcome::nowhere_near;
  Closure closure;          // from not_registered on
  double chi_square = 0.0;  // against the graph, from disagreed on; 0: the sections disagreed
};

struct Counters {
  std::uint64_t sweeps = 0, refused_sweeps = 0, invalid_points = 0;
  std::uint64_t attempts = 0;        // keyframes that may be revisits
  std::uint64_t unrecognized = 0;    // no place stood out
  std::uint64_t not_registered = 0;  // overlap, residual or axis
  std::uint64_t disagreed = 0;       // sections, or the graph's chi-square
  std::uint64_t closures = 0;
  std::uint64_t switched_off = 0;  // taken, and found false by the graph
  std::uint64_t keyframes_refused = 0;
};

class Mapper {
 public:
  explicit Mapper(const Config& config = {});
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  struct Update {
    bool used = false;  // the sweep went into the map
    bool keyframe = false;
    bool moved = false;  // closures changed the map: map_odom() and all poses
  };
  // `odometry`: T_odom_sensor covering the sweep. `unobserved`: axis that the odometry did not observe in this sweep
  // [sensor frame], or zero.
  Update add(const Sweep& sweep, const Trajectory& odometry,
             const Eigen::Vector3d& unobserved = Eigen::Vector3d::Zero());
  // No more sweeps come: tries what still waits. True if the map changed.
  bool finish();

  // Continuous odom in the globally consistent map.
  Pose map_odom() const;
  // Keyframes' poses in the map.
  Trajectory trajectory() const;
  // The odometry's poses at the same stamps.
  Trajectory odometry() const;
  const std::vector<Closure>& closures() const;
  const pose_graph::PoseGraph& graph() const;
  const Counters& counters() const;
  const Attempt& last_attempt() const;

  // In the map. The local one: what is around now; the global one: of all keyframes, one point a voxel [m].
  Points local_map() const;
  Points global_map(double voxel) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::mapping
