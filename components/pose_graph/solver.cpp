#include "components/pose_graph/solver.hpp"

#include <ceres/autodiff_cost_function.h>
#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>

#include <cmath>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace adit::pose_graph::detail {
namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;

// Keeps the covariance of unconnected nodes finite [1/m^2].
constexpr double least_information = 1e-9;

// e = [R_m^T (R_f^T (t_t - t_f) / s_f - t_m); log(R_m^T R_f^T R_t); log(s_t / s_f) - log s_m], whitened.
struct Term {
  Eigen::Vector3d t;
  Eigen::Quaterniond q;
  Matrix6d root;
  double log_scale;
  double scale_root;

  Term(const Edge& edge, const Matrix6d& edge_root)
      : t(edge.T_from_to.translation()),
        q(edge.T_from_to.linear()),
        root(edge_root),
        log_scale(edge.log_scale),
        scale_root(std::sqrt(edge.log_scale_information)) {}

  template <class T>
  bool operator()(const T* from_t, const T* from_q, const T* from_s, const T* to_t, const T* to_q, const T* to_s,
                  T* out) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    using Quaternion = Eigen::Quaternion<T>;
    const Eigen::Map<const Vector> t_f(from_t), t_t(to_t);
    const Quaternion back = Eigen::Map<const Quaternion>(from_q).conjugate();
    const Quaternion measured_back = q.conjugate().cast<T>();
    const Vector seen = back * Vector(t_t - t_f) * exp(-*from_s);
    Eigen::Matrix<T, 6, 1> error;
    error.template head<3>() = measured_back * Vector(seen - t.cast<T>());
    const Quaternion turn = measured_back * back * Eigen::Map<const Quaternion>(to_q);
    const T wxyz[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
    ceres::QuaternionToAngleAxis(wxyz, error.data() + 3);
    Eigen::Map<Eigen::Matrix<T, 6, 1>> whitened(out);
    whitened = root.cast<T>() * error;
    out[6] = scale_root * (*to_s - *from_s - log_scale);
    return true;
  }
};

// k s / (k + s) of the squared residual s: at s = k the weight is a quarter, far beyond it nothing.
class GemanMcClure final : public ceres::LossFunction {
 public:
  explicit GemanMcClure(double k) : k_(k) {}
  void Evaluate(double s, double out[3]) const override {
    const double part = k_ / (k_ + s);
    out[0] = part * s;
    out[1] = part * part;
    out[2] = -2.0 * out[1] / (k_ + s);
  }

 private:
  double k_;
};

// The graph as Ceres is given it. Node 0 and, for rigid motions, all scales are held.
class Problem {
 public:
  Problem(Graph& graph, bool estimate_scale, ceres::LossFunction* loop_loss) : problem_(options()) {
    for (Node& node : graph.nodes) add(node, &node == &graph.nodes.front(), estimate_scale);
    for (std::size_t i = 0; i < graph.edges.size(); ++i) {
      const bool loop = graph.edges[i].kind == EdgeKind::loop;
      terms_.push_back(add(graph, graph.edges[i], graph.roots[i], loop ? loop_loss : nullptr));
    }
  }

  ceres::Problem& get() { return problem_; }
  const std::vector<ceres::ResidualBlockId>& terms() const { return terms_; }

  ceres::ResidualBlockId add(Graph& graph, const Edge& edge, const Matrix6d& root, ceres::LossFunction* loss) {
    Node& from = graph.nodes[edge.from];
    Node& to = graph.nodes[edge.to];
    using Cost = ceres::AutoDiffCostFunction<Term, Residual::RowsAtCompileTime, 3, 4, 1, 3, 4, 1>;
    return problem_.AddResidualBlock(new Cost(new Term(edge, root)), loss, from.position.data(),
                                     from.rotation.coeffs().data(), &from.log_scale, to.position.data(),
                                     to.rotation.coeffs().data(), &to.log_scale);
  }

  // Of these terms by all free unknowns, without losses.
  SparseMatrix jacobian(const std::vector<ceres::ResidualBlockId>& terms) {
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = free_;
    options.residual_blocks = terms;
    options.apply_loss_function = false;
    ceres::CRSMatrix rows;
    problem_.Evaluate(options, nullptr, nullptr, nullptr, &rows);
    using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;
    return Eigen::Map<const RowMajor>(rows.num_rows, rows.num_cols, static_cast<Eigen::Index>(rows.values.size()),
                                      rows.rows.data(), rows.cols.data(), rows.values.data());
  }

 private:
  static ceres::Problem::Options options() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  void add(Node& node, bool held, bool estimate_scale) {
    double* rotation = node.rotation.coeffs().data();
    problem_.AddParameterBlock(node.position.data(), 3);
    problem_.AddParameterBlock(rotation, 4, new ceres::EigenQuaternionManifold);
    problem_.AddParameterBlock(&node.log_scale, 1);
    const auto settle = [this](double* block, bool hold) {
      if (hold) {
        problem_.SetParameterBlockConstant(block);
      } else {
        free_.push_back(block);
      }
    };
    settle(node.position.data(), held);
    settle(rotation, held);
    settle(&node.log_scale, held || !estimate_scale);
  }

  ceres::Problem problem_;
  std::vector<double*> free_;
  std::vector<ceres::ResidualBlockId> terms_;
};

}  // namespace

Pose Node::pose() const {
  Pose pose = Pose::Identity();
  pose.translation() = position;
  pose.linear() = rotation.normalized().toRotationMatrix();
  return pose;
}

Residual residual(const std::vector<Node>& nodes, const Edge& edge, const Matrix6d& root) {
  const Node& from = nodes[edge.from];
  const Node& to = nodes[edge.to];
  Residual out;
  Term(edge, root)(from.position.data(), from.rotation.coeffs().data(), &from.log_scale, to.position.data(),
                   to.rotation.coeffs().data(), &to.log_scale, out.data());
  return out;
}

void minimize(Graph& graph, const Config& config, std::optional<double> loop_scale, Report& report) {
  GemanMcClure loss(loop_scale.value_or(1.0));
  Problem problem(graph, config.estimate_scale, loop_scale ? &loss : nullptr);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;  // one thread, no BLAS: the same bytes everywhere
  options.num_threads = 1;
  options.max_num_iterations = config.max_iterations;
  options.function_tolerance = 1e-9;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem.get(), &summary);
  report.converged = summary.termination_type == ceres::CONVERGENCE;
  report.cost = summary.final_cost;
  report.iterations += static_cast<int>(summary.iterations.size());
}

Result<Matrix6d> covariance(Graph& graph, const Config& config, const Edge& edge) {
  Problem problem(graph, config.estimate_scale, nullptr);
  SparseMatrix jacobian = problem.jacobian(problem.terms());
  // Weighted by the switches, without the loss' curvature: an edge that is off says nothing.
  Eigen::VectorXd weight(jacobian.rows());
  constexpr int rows = Residual::RowsAtCompileTime;
  for (std::size_t i = 0; i < graph.switches.size(); ++i) {
    weight.segment<rows>(static_cast<Eigen::Index>(i) * rows).setConstant(graph.switches[i]);
  }
  jacobian = weight.asDiagonal() * jacobian;
  SparseMatrix hessian = jacobian.transpose() * jacobian;
  for (Eigen::Index i = 0; i < hessian.rows(); ++i) hessian.coeffRef(i, i) += least_information;
  const Eigen::SimplicialLDLT<SparseMatrix> inverse(hessian);

  const ceres::ResidualBlockId term = problem.add(graph, edge, Matrix6d::Identity(), nullptr);
  const Eigen::MatrixXd error = Eigen::MatrixXd(problem.jacobian({term})).topRows<6>();
  if (inverse.info() != Eigen::Success) return Error{ErrorCode::internal, "the graph's information has no inverse"};
  const Matrix6d covariance = error * inverse.solve(Eigen::MatrixXd(error.transpose()));
  if (!covariance.allFinite()) return Error{ErrorCode::internal, "the graph's covariance is not finite"};
  return Matrix6d(0.5 * (covariance + covariance.transpose()));
}

}  // namespace adit::pose_graph::detail
