// Cost of a solution and of a candidate's check on laps of a 100-node circle with closures every ten nodes.
#include <benchmark/benchmark.h>

#include <numbers>
#include <random>

#include "components/pose_graph/pose_graph.hpp"

namespace adit::pose_graph {
namespace {

constexpr NodeId nodes_a_lap = 100;

PoseGraph laps(NodeId nodes) {
  PoseGraph graph;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Vector6d step = Vector6d::Zero();
  step[0] = 3.0;
  step[5] = 2.0 * std::numbers::pi / nodes_a_lap;
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(0.01), Eigen::Vector3d::Constant(0.001);
  const Matrix6d information = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  const auto noisy = [&](const Pose& pose) {
    Vector6d noise;
    for (int k = 0; k < 6; ++k) noise[k] = normal(random) * sigma[k];
    return Pose(pose * se3_exp(noise));
  };
  for (NodeId i = 0; i < nodes; ++i) {
    const Pose motion = noisy(se3_exp(step));
    (void)graph.add_node(i == 0 ? Pose::Identity() : Pose(graph.pose(i - 1) * motion));
    if (i > 0) (void)graph.add_edge({.from = i - 1, .to = i, .T_from_to = motion, .information = information});
    if (i >= nodes_a_lap && i % 10 == 0) {
      (void)graph.add_edge({.from = i - nodes_a_lap,
                            .to = i,
                            .T_from_to = noisy(Pose::Identity()),
                            .information = information,
                            .kind = EdgeKind::loop});
    }
  }
  return graph;
}

void solve(benchmark::State& state) {
  Report report;
  for (auto _ : state) {
    state.PauseTiming();
    PoseGraph graph = laps(static_cast<NodeId>(state.range(0)));
    state.ResumeTiming();
    report = graph.solve();
  }
  state.counters["iterations"] = report.iterations;
  state.counters["loops_off"] = static_cast<double>(report.loops_off);
}
BENCHMARK(solve)->Arg(100)->Arg(300)->Arg(1000)->Unit(benchmark::kMillisecond);

void check(benchmark::State& state) {
  const NodeId nodes = static_cast<NodeId>(state.range(0));
  PoseGraph graph = laps(nodes);
  graph.solve();
  const Edge edge{.from = 0, .to = nodes - 1, .kind = EdgeKind::loop};
  for (auto _ : state) benchmark::DoNotOptimize(graph.check(edge));
}
BENCHMARK(check)->Arg(300)->Arg(1000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace adit::pose_graph

BENCHMARK_MAIN();
