#include "components/pose_graph/pose_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "components/pose_graph/solver.hpp"

namespace adit::pose_graph {
namespace {

// A direction counts as observed above this part of the largest eigenvalue: sigma ratios up to 30 000.
constexpr double weakest_direction = 1e-9;
// Quantiles of chi-square at the probability of 3 sigma (99.73 %) for 1 to 6 dimensions.
constexpr std::array<double, 7> three_sigma = {0.0, 9.0, 11.83, 14.16, 16.25, 18.21, 20.06};

Error invalid(std::string message) {
  return {ErrorCode::invalid_argument, std::move(message)};
}

bool rigid(const Pose& pose) {
  if (!pose.matrix().allFinite()) return false;
  const Eigen::Matrix3d r = pose.linear();
  return (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6 && r.determinant() > 0.0;
}

struct Eigenpairs {
  Matrix6d vectors;
  Vector6d values;  // ascending, round-off below zero removed

  Matrix6d root() const { return values.cwiseSqrt().asDiagonal() * vectors.transpose(); }
};

Result<Eigenpairs> decompose(const Matrix6d& information) {
  if (!information.allFinite()) return invalid("information is not finite");
  const double round_off = 1e-6 * information.cwiseAbs().maxCoeff();
  if ((information - information.transpose()).cwiseAbs().maxCoeff() > round_off) {
    return invalid("information is not symmetric");
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(0.5 * (information + information.transpose()));
  if (solver.eigenvalues()[0] < -round_off) return invalid("information is not positive semidefinite");
  return Eigenpairs{solver.eigenvectors(), solver.eigenvalues().cwiseMax(0.0)};
}

// What add_edge refuses, but for the information.
Result<void> check_shape(const Edge& edge, std::size_t nodes) {
  if (edge.from >= nodes || edge.to >= nodes) return invalid("edge names a node that does not exist");
  if (edge.from == edge.to) return invalid("edge joins a node with itself");
  if (!rigid(edge.T_from_to)) return invalid("edge's pose is not a finite rigid motion");
  if (!std::isfinite(edge.log_scale) || !std::isfinite(edge.log_scale_information) || edge.log_scale_information < 0) {
    return invalid("edge's scale or its information is not finite and non-negative");
  }
  return {};
}

}  // namespace

struct PoseGraph::Impl {
  Config config;
  detail::Graph graph;
  std::vector<Pose> poses;  // of the nodes

  double chi_square(std::size_t i) const {
    return detail::residual(graph.nodes, graph.edges[i], graph.roots[i]).squaredNorm();
  }
  // At the present nodes; returns how many loops are off.
  std::size_t update_switches() {
    std::size_t off = 0;
    for (std::size_t i = 0; i < graph.edges.size(); ++i) {
      if (graph.edges[i].kind != EdgeKind::loop) continue;
      graph.switches[i] = config.loop_scale / (config.loop_scale + chi_square(i));
      off += graph.switches[i] < 0.5 ? 1 : 0;
    }
    return off;
  }
};

PoseGraph::PoseGraph(const Config& config) : impl_(std::make_unique<Impl>()) {
  impl_->config = config;
}
PoseGraph::~PoseGraph() = default;
PoseGraph::PoseGraph(PoseGraph&&) noexcept = default;
PoseGraph& PoseGraph::operator=(PoseGraph&&) noexcept = default;

Result<NodeId> PoseGraph::add_node(const Pose& guess, double scale_guess) {
  if (!rigid(guess)) return invalid("node's pose is not a finite rigid motion");
  if (!std::isfinite(scale_guess) || !(scale_guess > 0.0)) return invalid("node's scale is not finite and positive");
  impl_->graph.nodes.push_back({guess.translation(), Eigen::Quaterniond(guess.linear()), std::log(scale_guess)});
  impl_->poses.push_back(impl_->graph.nodes.back().pose());
  return static_cast<NodeId>(impl_->poses.size() - 1);
}

Result<void> PoseGraph::add_edge(const Edge& edge) {
  if (const Result<void> fine = check_shape(edge, size()); !fine) return fine.error();
  const Result<Eigenpairs> pairs = decompose(edge.information);
  if (!pairs) return pairs.error();
  impl_->graph.edges.push_back(edge);
  impl_->graph.roots.push_back(pairs->root());
  impl_->graph.switches.push_back(1.0);
  return {};
}

Report PoseGraph::solve() {
  detail::Graph& graph = impl_->graph;
  const double final_scale = impl_->config.loop_scale;
  Report report;
  report.converged = true;
  if (size() < 2) return report;
  // From where the nodes are: if all loops agree there, this is the solution.
  detail::minimize(graph, impl_->config, final_scale, report);
  report.loops_off = impl_->update_switches();
  if (report.loops_off > 0) {
    // From a loss that is convex up to the worst loop to the one wanted, by halves (Yang et al., remark 5).
    detail::minimize(graph, impl_->config, std::nullopt, report);
    double worst = 0.0;
    for (std::size_t i = 0; i < graph.edges.size(); ++i) {
      if (graph.edges[i].kind == EdgeKind::loop) worst = std::max(worst, impl_->chi_square(i));
    }
    constexpr double most = 1e12;  // a bound on the number of stages
    for (double scale = 2.0 * std::min(worst, most); scale > final_scale; scale *= 0.5) {
      detail::minimize(graph, impl_->config, scale, report);
    }
    detail::minimize(graph, impl_->config, final_scale, report);
    report.loops_off = impl_->update_switches();
  }
  for (std::size_t i = 0; i < size(); ++i) impl_->poses[i] = graph.nodes[i].pose();
  return report;
}

std::size_t PoseGraph::size() const {
  return impl_->poses.size();
}
const Pose& PoseGraph::pose(NodeId node) const {
  return impl_->poses[node];
}
double PoseGraph::scale(NodeId node) const {
  return std::exp(impl_->graph.nodes[node].log_scale);
}
std::span<const Edge> PoseGraph::edges() const {
  return impl_->graph.edges;
}
double PoseGraph::switch_of(std::size_t edge) const {
  return impl_->graph.switches[edge];
}

Result<Relative> PoseGraph::relative(NodeId from, NodeId to) const {
  Edge edge{.from = from, .to = to};
  if (const Result<void> fine = check_shape(edge, size()); !fine) return fine.error();
  edge.T_from_to = pose(from).inverse() * pose(to);
  edge.T_from_to.translation() /= scale(from);
  const Result<Matrix6d> covariance = detail::covariance(impl_->graph, impl_->config, edge);
  if (!covariance) return covariance.error();
  return Relative{edge.T_from_to, *covariance};
}

Result<Agreement> PoseGraph::check(const Edge& candidate) const {
  if (const Result<void> fine = check_shape(candidate, size()); !fine) return fine.error();
  const Result<Eigenpairs> pairs = decompose(candidate.information);
  if (!pairs) return pairs.error();
  const Result<Matrix6d> known = detail::covariance(impl_->graph, impl_->config, candidate);
  if (!known) return known.error();

  Agreement agreement;
  const double largest = pairs->values[5];
  for (int i = 0; i < 6; ++i) agreement.dimensions += largest > 0 && pairs->values[i] > weakest_direction * largest;
  const int n = agreement.dimensions;
  if (n == 0) return agreement;  // observes nothing: nothing speaks for it
  const Eigen::MatrixXd observed = pairs->vectors.rightCols(n);
  const Vector6d error = detail::residual(impl_->graph.nodes, candidate, Matrix6d::Identity()).head<6>();
  const Eigen::VectorXd projected = observed.transpose() * error;
  Eigen::MatrixXd spread = observed.transpose() * *known * observed;
  spread.diagonal() += pairs->values.tail(n).cwiseInverse();
  agreement.chi_square = projected.dot(spread.ldlt().solve(projected));
  agreement.plausible = agreement.chi_square < three_sigma[static_cast<std::size_t>(n)];
  return agreement;
}

}  // namespace adit::pose_graph
