// The least-squares side of a pose graph: its terms, their minimum, and what they say of a relative pose. Ceres is in
// the .cpp only.
#pragma once

#include <optional>
#include <vector>

#include "components/pose_graph/pose_graph.hpp"

namespace adit::pose_graph::detail {

// A similarity x_map = exp(log_scale) R x + position.
struct Node {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  double log_scale = 0.0;

  Pose pose() const;
};

struct Graph {
  std::vector<Node> nodes;
  std::vector<Edge> edges;
  std::vector<Matrix6d> roots;   // root^T root is the information of the edge of that index
  std::vector<double> switches;  // of the edges
};

// Error of an edge at the present nodes: to first order the xi of T_from_to * se3_exp(xi), and that of the log of the
// scale; the first six rows multiplied by `root`, the last one by the root of its information.
using Residual = Eigen::Matrix<double, 7, 1>;
Residual residual(const std::vector<Node>& nodes, const Edge& edge, const Matrix6d& root);

// Moves the nodes to the minimum. `loop_scale`: of the loops' Geman-McClure loss; nothing: least squares.
// Adds its iterations to the report, and sets the rest of it but loops_off.
void minimize(Graph& graph, const Config& config, std::optional<double> loop_scale, Report& report);

// Covariance of the relative pose of two nodes, as the error of `edge` between them, edges weighted by their switches.
Result<Matrix6d> covariance(Graph& graph, const Config& config, const Edge& edge);

}  // namespace adit::pose_graph::detail
