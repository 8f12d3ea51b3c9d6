#include "components/pose_graph/pose_graph.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>
#include <thread>
#include <vector>

namespace adit::pose_graph {
namespace {

Vector6d vector6(double x, double y, double z, double rx, double ry, double rz) {
  return (Vector6d() << x, y, z, rx, ry, rz).finished();
}

Matrix6d information(double sigma_m, double sigma_rad) {
  Vector6d diagonal;
  diagonal << Eigen::Vector3d::Constant(1.0 / (sigma_m * sigma_m)),
      Eigen::Vector3d::Constant(1.0 / (sigma_rad * sigma_rad));
  return diagonal.asDiagonal();
}

// A walk of `nodes` nodes along a circle of that circumference [m], started again and again; truth and odometry edges
// with seeded noise. The graph has the odometry's poses as first guess.
struct Walk {
  std::vector<Pose> truth;
  PoseGraph graph;

  Walk(std::size_t nodes, std::size_t nodes_a_lap, double step, unsigned seed, const Config& config = {},
       double sigma_m = 0.02, double sigma_rad = 0.002)
      : graph(config) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const Pose motion = se3_exp(vector6(step, 0, 0, 0, 0, 2.0 * std::numbers::pi / static_cast<double>(nodes_a_lap)));
    Pose guess = Pose::Identity();
    for (std::size_t i = 0; i < nodes; ++i) {
      truth.push_back(i == 0 ? Pose::Identity() : truth.back() * motion);
      if (i == 0) {
        EXPECT_TRUE(graph.add_node(guess));
        continue;
      }
      Vector6d noise;
      for (int k = 0; k < 6; ++k) noise[k] = normal(random) * (k < 3 ? sigma_m : sigma_rad);
      const Pose measured = motion * se3_exp(noise);
      guess = guess * measured;
      EXPECT_TRUE(graph.add_node(guess));
      EXPECT_TRUE(graph.add_edge({.from = static_cast<NodeId>(i - 1),
                                  .to = static_cast<NodeId>(i),
                                  .T_from_to = measured,
                                  .information = information(sigma_m, sigma_rad)}));
    }
  }
  Edge loop(NodeId from, NodeId to, double sigma_m = 0.02, double sigma_rad = 0.002) const {
    return {.from = from,
            .to = to,
            .T_from_to = truth[from].inverse() * truth[to],
            .information = information(sigma_m, sigma_rad),
            .kind = EdgeKind::loop};
  }
  double error(NodeId node) const { return (graph.pose(node).translation() - truth[node].translation()).norm(); }
  double rms() const {
    double sum = 0.0;
    for (NodeId i = 0; i < truth.size(); ++i) sum += error(i) * error(i);
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }
};

TEST(PoseGraph, AStraightLineIsSharedByTheVariances) {
  // Three steps along x with variances 1, 2, 1 (in cm^2) that say 1.00 m each, and a closure of the whole that says
  // 3.10 m with variance 1. Least squares by hand: 10 cm over total variance 5 are 2, 4, 2 cm to the steps.
  PoseGraph graph({.loop_scale = 1e9});  // quadratic: the hand calculation has no loss
  const double steps[] = {1.0, 2.0, 1.0};
  ASSERT_TRUE(graph.add_node(Pose::Identity()));
  const auto along_x = [](double x) { return Pose(Eigen::Translation3d(x, 0, 0)); };
  for (NodeId i = 0; i < 3; ++i) {
    ASSERT_TRUE(graph.add_node(along_x(i + 1.0)));
    const double sigma = 0.01 * std::sqrt(steps[i]);
    ASSERT_TRUE(
        graph.add_edge({.from = i, .to = i + 1, .T_from_to = along_x(1.0), .information = information(sigma, 0.001)}));
  }
  ASSERT_TRUE(graph.add_edge({.from = 0,
                              .to = 3,
                              .T_from_to = along_x(3.1),
                              .information = information(0.01, 0.001),
                              .kind = EdgeKind::loop}));
  EXPECT_TRUE(graph.solve().converged);
  EXPECT_NEAR(graph.pose(1).translation().x(), 1.02, 1e-6);
  EXPECT_NEAR(graph.pose(2).translation().x(), 2.06, 1e-6);
  EXPECT_NEAR(graph.pose(3).translation().x(), 3.08, 1e-6);
  EXPECT_EQ(graph.pose(0).translation(), Eigen::Vector3d::Zero().eval());
}

TEST(PoseGraph, ASquareWithAHeadingErrorIsClosedAsByHand) {
  // Four sides of 10 m with left turns; every turn is measured d too large, all else exact and with tiny variance, so
  // the closure's 4 d are shared equally by the four turns: the square is exact again.
  const double d = 0.01, turn = std::numbers::pi / 2.0;
  PoseGraph graph;
  Pose guess = Pose::Identity();
  ASSERT_TRUE(graph.add_node(guess));
  Matrix6d sides = information(1e-4, 1.0);
  const Pose side = Pose(Eigen::Translation3d(10, 0, 0)) * Eigen::AngleAxisd(turn + d, Eigen::Vector3d::UnitZ());
  sides(5, 5) = 1.0 / (d * d);
  sides(3, 3) = sides(4, 4) = 1e8;
  for (NodeId i = 0; i < 4; ++i) {
    guess = guess * side;
    ASSERT_TRUE(graph.add_node(guess));
    ASSERT_TRUE(graph.add_edge({.from = i, .to = i + 1, .T_from_to = side, .information = sides}));
  }
  ASSERT_TRUE(graph.add_edge({.from = 0, .to = 4, .information = information(1e-4, 1e-4), .kind = EdgeKind::loop}));
  const Report report = graph.solve();
  EXPECT_TRUE(report.converged);
  EXPECT_EQ(report.loops_off, 0u);
  EXPECT_LT((graph.pose(2).translation() - Eigen::Vector3d(10, 10, 0)).norm(), 1e-3);
  EXPECT_LT((graph.pose(4).translation()).norm(), 1e-3);
  EXPECT_NEAR(yaw(graph.pose(1).linear()), turn, 1e-4);
}

TEST(PoseGraph, LoopsRemoveTheDriftOfASquareWalk) {
  Walk walk(201, 100, 1.0, 7);
  const double before = walk.rms();
  for (NodeId i = 100; i <= 200; i += 10) ASSERT_TRUE(walk.graph.add_edge(walk.loop(i - 100, i)));
  const Report report = walk.graph.solve();
  EXPECT_TRUE(report.converged);
  EXPECT_EQ(report.loops_off, 0u);
  EXPECT_LT(walk.rms(), 0.5 * before);
  EXPECT_LT(walk.error(100), 0.08);  // two sigma of one closure and change
}

TEST(PoseGraph, FalseLoopsAreSwitchedOffAndTrueOnesKept) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    Walk with(201, 100, 1.0, seed), without(201, 100, 1.0, seed);
    for (NodeId i = 100; i <= 200; i += 10) {
      ASSERT_TRUE(with.graph.add_edge(with.loop(i - 100, i)));
      ASSERT_TRUE(without.graph.add_edge(without.loop(i - 100, i)));
    }
    const std::size_t first_false = with.graph.edges().size();
    for (NodeId i = 20; i < 50; i += 10) {  // the other side of the circle taken for this one
      Edge wrong = with.loop(i, i + 50);
      wrong.T_from_to = Pose::Identity();
      ASSERT_TRUE(with.graph.add_edge(wrong));
    }
    EXPECT_EQ(with.graph.solve().loops_off, 3u);
    without.graph.solve();
    for (std::size_t i = 0; i < with.graph.edges().size(); ++i) {
      EXPECT_EQ(with.graph.switch_of(i) > 0.5, i < first_false) << "seed " << seed << " edge " << i;
    }
    EXPECT_LT((with.graph.pose(150).translation() - without.graph.pose(150).translation()).norm(), 0.02);
  }
}

TEST(PoseGraph, ALoopWithAWeakAxisDoesNotBendTheOthers) {
  // The closure is 5 m wrong along the tunnel (its x) and says nothing about x: solution as with a true closure.
  Walk exact(101, 100, 1.0, 3), wrong(101, 100, 1.0, 3);
  Edge edge = exact.loop(0, 100);
  edge.information.row(0).setZero();
  edge.information.col(0).setZero();
  ASSERT_TRUE(exact.graph.add_edge(edge));
  edge.T_from_to.translation().x() += 5.0;
  ASSERT_TRUE(wrong.graph.add_edge(edge));
  EXPECT_EQ(exact.graph.solve().loops_off, 0u);
  EXPECT_EQ(wrong.graph.solve().loops_off, 0u);
  for (NodeId i = 0; i <= 100; ++i) {
    EXPECT_LT((exact.graph.pose(i).matrix() - wrong.graph.pose(i).matrix()).cwiseAbs().maxCoeff(), 1e-6) << i;
  }
  // And what it does observe is closed.
  const Pose error = wrong.truth[100].inverse() * wrong.graph.pose(100);
  EXPECT_LT(std::abs(error.translation().y()), 0.05);
}

TEST(PoseGraph, AWeakAxisThatIsObliqueIsLeftAloneToo) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 0.5).normalized();
  Walk exact(41, 100, 1.0, 5), wrong(41, 100, 1.0, 5);
  Edge edge = exact.loop(0, 40, 0.02, 0.002);
  edge.information.topLeftCorner<3, 3>() = (Eigen::Matrix3d::Identity() - axis * axis.transpose()) / (0.02 * 0.02);
  ASSERT_TRUE(exact.graph.add_edge(edge));
  edge.T_from_to = edge.T_from_to * Eigen::Translation3d(3.0 * axis);
  ASSERT_TRUE(wrong.graph.add_edge(edge));
  exact.graph.solve();
  wrong.graph.solve();
  EXPECT_LT((exact.graph.pose(40).matrix() - wrong.graph.pose(40).matrix()).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(PoseGraph, CovarianceGrowsAsTheSumOfTheSteps) {
  PoseGraph graph;
  ASSERT_TRUE(graph.add_node(Pose::Identity()));
  const Pose step(Eigen::Translation3d(2, 0, 0));
  for (NodeId i = 0; i < 10; ++i) {
    ASSERT_TRUE(graph.add_node(graph.pose(i) * step));
    ASSERT_TRUE(graph.add_edge({.from = i, .to = i + 1, .T_from_to = step, .information = information(0.1, 0.01)}));
  }
  const Result<Relative> relative = graph.relative(0, 10);
  ASSERT_TRUE(relative) << relative.error().message;
  EXPECT_NEAR(relative->covariance(0, 0), 10 * 0.01, 1e-6);
  EXPECT_NEAR(relative->covariance(3, 3), 10 * 1e-4, 1e-8);
  // Sideways: 10 steps and the levers 18, 16, ... 0 m of the headings before.
  double sideways = 10 * 0.01;
  for (int i = 0; i < 10; ++i) sideways += 1e-4 * std::pow(2.0 * i, 2);
  EXPECT_NEAR(relative->covariance(1, 1), sideways, 1e-6);
  const Result<Relative> inner = graph.relative(7, 3);
  ASSERT_TRUE(inner);
  EXPECT_NEAR(inner->covariance(0, 0), 0.04, 1e-6);
  EXPECT_NEAR(inner->T_from_to.translation().x(), -8.0, 1e-12);
}

TEST(PoseGraph, CandidatesAreJudgedByTheCovarianceOfTheWayBetween) {
  int taken = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Walk walk(31, 100, 1.0, seed);
    const Result<Agreement> agreement = walk.graph.check(walk.loop(0, 30, 1e-4, 1e-5));
    ASSERT_TRUE(agreement);
    EXPECT_EQ(agreement->dimensions, 6);
    taken += agreement->plausible;
  }
  EXPECT_GE(taken, 195);  // 99.73 % expected; 5 or more of 200 refused has a chance of 1e-4
  const Walk walk(31, 100, 1.0, 1);
  Edge wrong = walk.loop(0, 30);
  wrong.T_from_to = wrong.T_from_to * Eigen::Translation3d(2.0, 0, 0);
  EXPECT_FALSE(walk.graph.check(wrong)->plausible);
  wrong.information.row(0).setZero();
  wrong.information.col(0).setZero();
  const Result<Agreement> blind = walk.graph.check(wrong);
  EXPECT_EQ(blind->dimensions, 5);
  EXPECT_TRUE(blind->plausible);
  wrong.information.setZero();
  EXPECT_FALSE(walk.graph.check(wrong)->plausible);
}

TEST(PoseGraph, ScaleDriftIsClosedWithSimilarities) {
  // A monocular camera whose unit grows by 1 % a step on a circle: the closure knows position and scale.
  Config config;
  config.estimate_scale = true;
  PoseGraph graph(config);
  const std::size_t lap = 60;
  const Pose motion = se3_exp(vector6(1, 0, 0, 0, 0, 2.0 * std::numbers::pi / lap));
  std::vector<Pose> truth{Pose::Identity()};
  ASSERT_TRUE(graph.add_node(Pose::Identity()));
  Pose guess = Pose::Identity();
  double unit = 1.0;  // true metres a unit at the present node
  for (NodeId i = 0; i < lap; ++i) {
    Pose measured = motion;
    measured.translation() /= unit;
    guess = guess * measured;
    ASSERT_TRUE(graph.add_node(guess));
    ASSERT_TRUE(graph.add_edge({.from = i,
                                .to = i + 1,
                                .T_from_to = measured,
                                .information = information(0.05, 0.01),
                                .log_scale = 0.0,
                                .log_scale_information = 1.0 / (0.01 * 0.01)}));
    unit *= 1.01;
    truth.push_back(truth.back() * motion);
  }
  const double before = (guess.translation() - truth.back().translation()).norm();
  ASSERT_TRUE(graph.add_edge({.from = 0,
                              .to = lap,
                              .information = information(0.01, 0.001),
                              .kind = EdgeKind::loop,
                              .log_scale = std::log(unit),
                              .log_scale_information = 1e6}));
  EXPECT_EQ(graph.solve().loops_off, 0u);
  EXPECT_GT(before, 1.0);
  EXPECT_NEAR(graph.scale(lap), unit, 0.01 * unit);
  EXPECT_NEAR(graph.scale(lap / 2), std::sqrt(unit), 0.05 * std::sqrt(unit));
  EXPECT_LT((graph.pose(lap / 2).translation() - truth[lap / 2].translation()).norm(), 0.3 * before);
}

TEST(PoseGraph, BadInputIsRefusedAndChangesNothing) {
  Walk walk(5, 100, 1.0, 1);
  PoseGraph& graph = walk.graph;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Pose bad = Pose::Identity();
  bad.translation().x() = nan;
  EXPECT_FALSE(graph.add_node(bad));
  bad = Pose::Identity();
  bad.linear() *= 1.1;
  EXPECT_FALSE(graph.add_node(bad));
  EXPECT_FALSE(graph.add_node(Pose::Identity(), 0.0));

  const Edge good = walk.loop(0, 4);
  const auto refused = [&graph](const Edge& edge) { return !graph.add_edge(edge) && !graph.check(edge); };
  Edge edge = good;
  edge.T_from_to = bad;
  EXPECT_TRUE(refused(edge));
  edge = good;
  edge.to = 5;
  EXPECT_TRUE(refused(edge));
  edge.to = edge.from;
  EXPECT_TRUE(refused(edge));
  edge = good;
  edge.information(2, 2) = nan;
  EXPECT_TRUE(refused(edge));
  edge = good;
  edge.information(2, 2) = -1.0;
  EXPECT_TRUE(refused(edge));
  edge = good;
  edge.information(0, 1) += 100.0;
  EXPECT_TRUE(refused(edge));
  edge = good;
  edge.log_scale_information = -1.0;
  EXPECT_TRUE(refused(edge));
  EXPECT_EQ(graph.size(), 5u);
  EXPECT_EQ(graph.edges().size(), 4u);
  EXPECT_FALSE(graph.relative(0, 5));
}

TEST(PoseGraph, NodesWithoutEdgesAndEmptyInformationStayFinite) {
  Walk walk(5, 100, 1.0, 1);
  const Result<NodeId> alone = walk.graph.add_node(Pose(Eigen::Translation3d(1, 2, 3)));
  ASSERT_TRUE(alone);
  Edge empty = walk.loop(0, 4);
  empty.information.setZero();
  ASSERT_TRUE(walk.graph.add_edge(empty));
  EXPECT_TRUE(walk.graph.solve().converged);
  for (NodeId i = 0; i < walk.graph.size(); ++i) EXPECT_TRUE(walk.graph.pose(i).matrix().allFinite());
  EXPECT_LT((walk.graph.pose(*alone).translation() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-9);
  const Result<Relative> relative = walk.graph.relative(0, *alone);
  ASSERT_TRUE(relative);
  EXPECT_GT(relative->covariance(0, 0), 1e6);
  EXPECT_TRUE(PoseGraph().solve().converged);
}

TEST(PoseGraph, TheSameBytesWheneverAndWhereverItIsSolved) {
  const auto solved = [] {
    Walk walk(201, 100, 1.0, 11);
    for (NodeId i = 100; i <= 200; i += 5) EXPECT_TRUE(walk.graph.add_edge(walk.loop(i - 100, i)));
    walk.graph.solve();
    std::vector<double> numbers;
    for (NodeId i = 0; i < walk.graph.size(); ++i) {
      const Eigen::Matrix4d& m = walk.graph.pose(i).matrix();
      numbers.insert(numbers.end(), m.data(), m.data() + m.size());
    }
    return numbers;
  };
  const std::vector<double> here = solved();
  std::vector<std::vector<double>> there(4);
  {
    std::vector<std::jthread> threads;
    for (std::vector<double>& out : there) threads.emplace_back([&out, &solved] { out = solved(); });
  }
  for (const std::vector<double>& other : there) {
    ASSERT_EQ(other.size(), here.size());
    EXPECT_EQ(std::memcmp(other.data(), here.data(), here.size() * sizeof(double)), 0);
  }
}

TEST(PoseGraph, GrowsAndIsSolvedAgain) {
  Walk walk(301, 100, 1.0, 21);
  for (NodeId i = 100; i <= 300; i += 20) {
    ASSERT_TRUE(walk.graph.add_edge(walk.loop(i - 100, i)));
    EXPECT_EQ(walk.graph.solve().loops_off, 0u);
  }
  EXPECT_LT(walk.error(300), 0.1);
}

}  // namespace
}  // namespace adit::pose_graph
