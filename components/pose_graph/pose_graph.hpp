// Pose graphs: where a body was, from its odometry and from the places it recognized. Nodes are poses in one frame
// (`map`), edges are measured relative poses; the solution is the maximum-a-posteriori trajectory, loop edges under a
// robust loss that switches a false one off. Node 0 is held (the gauge).
//
// Plain library: no middleware, clock, logging or threads; one caller at a time; same input, same bytes. Bad input is
// refused with an Error and leaves the graph as it was; no output is ever NaN or infinite.
//
// Grisetti, Kuemmerle, Stachniss, Burgard, "A tutorial on graph-based SLAM" (2010). Switchable constraints:
// Suenderhauf, Protzel (2012); with the switch eliminated they are the Geman-McClure loss (Agarwal et al. 2013). Its
// solution from far away: graduated non-convexity (Yang et al. 2020). Similarities (scale): Strasdat et al. (2010).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "components/geometry/se3.hpp"
#include "idl/result.hpp"

namespace adit::pose_graph {

using NodeId = std::uint32_t;  // 0, 1, 2, ... in the order of add_node

enum class EdgeKind : std::uint8_t {
  odometry,  // believed as it is
  loop,      // may be false: under the robust loss
};

struct Edge {
  NodeId from = 0;
  NodeId to = 0;
  // Coordinates of node `to` to coordinates of node `from` [m].
  Pose T_from_to = Pose::Identity();
  // Of the right perturbation T_from_to * se3_exp([translation; rotation]) [1/m^2, 1/rad^2]. Symmetric and positive
  // semidefinite; a direction without information (an unobserved tunnel axis) is left alone by this edge.
  Matrix6d information = Matrix6d::Identity();
  EdgeKind kind = EdgeKind::odometry;
  // Only with Config::estimate_scale: log(scale of to / scale of from), and its information [1]. A node's scale is
  // metres a unit of its own coordinates; T_from_to is in units of `from`.
  double log_scale = 0.0;
  double log_scale_information = 0.0;
};

struct Config {
  // A loop edge at this chi-square has switch 0.5. Default: 99.9 % of 6 degrees of freedom.
  double loop_scale = 22.46;
  // Similarities instead of rigid motions: every node has a scale, that of node 0 is 1.
  bool estimate_scale = false;
  int max_iterations = 50;  // of each of the solver's stages
};

struct Report {
  bool converged = false;
  double cost = 0.0;          // half the sum of squares, loop edges by their robust loss
  int iterations = 0;         // linear systems solved, over all stages
  std::size_t loops_off = 0;  // loop edges with switch < 0.5
};

// What the graph says of `to` seen from `from`.
struct Relative {
  Pose T_from_to = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();  // right perturbation [m^2, rad^2]
};

// A loop edge against the graph without it.
struct Agreement {
  double chi_square = 0.0;  // of T_from_to under covariance of graph + edge, in the directions that the edge observes
  int dimensions = 0;       // observed directions
  bool plausible = false;   // chi_square below the 3-sigma (99.73 %) quantile of that many dimensions
};

class PoseGraph {
 public:
  explicit PoseGraph(const Config& config = {});
  ~PoseGraph();
  PoseGraph(PoseGraph&&) noexcept;
  PoseGraph& operator=(PoseGraph&&) noexcept;

  // `guess`: pose in the map, e.g. the last node's times the odometry since. Refused: not a finite rigid motion.
  Result<NodeId> add_node(const Pose& guess, double scale_guess = 1.0);
  // Refused: unknown or equal nodes, a pose that is not finite and rigid, information that is not finite, symmetric and
  // positive semidefinite.
  Result<void> add_edge(const Edge& edge);

  // Moves all nodes but the first to the solution. Milliseconds for hundreds of nodes; nodes without an edge stay.
  Report solve();

  std::size_t size() const;
  const Pose& pose(NodeId node) const;  // precondition: node < size()
  double scale(NodeId node) const;      // precondition: node < size()
  std::span<const Edge> edges() const;
  // 1: believed, 0: off; 1 for odometry edges and before the first solve(). Precondition: edge < edges().size().
  double switch_of(std::size_t edge) const;

  // Linearized at the present poses, loop edges weighted by their switches, scale marginalized. Refused: unknown or
  // equal nodes. Nodes that no chain of informative edges joins have a covariance of up to 1e9 m^2.
  Result<Relative> relative(NodeId from, NodeId to) const;
  // Should this loop edge be taken? Refused: what add_edge refuses.
  Result<Agreement> check(const Edge& candidate) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::pose_graph
