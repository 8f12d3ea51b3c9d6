// Between two processes: the whole runtime with typed messages beside bare programs on the vendor's own API. The pairs
// of one cell are alive together and measured in turns, so that what else runs on the machine meets all alike.
#include <map>
#include <utility>

#include "middleware/participant.hpp"
#include "tests/benchmarks/bench.hpp"
#include "tests/benchmarks/board.hpp"

namespace adit::bench {
namespace {

constexpr std::array<const char*, 3> implementations = {"runtime", "bare", "bare_listener"};
constexpr int turns = 6;
constexpr double turn_seconds = 0.5;

double rate(std::size_t bytes) {
  if (bytes <= 1'000) return 500;
  if (bytes <= 64'000) return 200;
  return bytes <= 1'000'000 ? 30 : 10;
}

struct Figures {
  std::vector<double> latency_us;
  double cpu_us = 0;  // of both sides
  std::uint64_t sent = 0, handled = 0, failed = 0, allocations = 0, copied = 0;
  std::vector<double> messages_per_second;

  double cpu_per_message() const { return cpu_us / static_cast<double>(std::max<std::uint64_t>(handled, 1)); }
  double allocations_per_message() const {
    return static_cast<double>(allocations) / static_cast<double>(std::max<std::uint64_t>(handled, 1));
  }
};

struct Cell {
  std::array<Figures, implementations.size()> figures;
  std::string failure;
};

void add(Figures& to, const Pair::Figures& turn) {
  to.latency_us.insert(to.latency_us.end(), turn.latency_us.begin(), turn.latency_us.end());
  to.cpu_us += turn.sender.cpu_us + turn.receiver.cpu_us;
  to.sent += turn.sender.messages;
  to.failed += turn.sender.failed;
  to.handled += turn.receiver.messages;
  to.allocations += turn.receiver.allocations;
  to.copied += turn.receiver.copied;
}

Cell measure(const std::string& vendor, std::size_t bytes) {
  Cell cell;
  std::vector<std::unique_ptr<Pair>> pairs;
  for (std::size_t i = 0; i < implementations.size(); ++i) {
    const auto domain = private_domain() + static_cast<std::uint32_t>(i);
    pairs.push_back(std::make_unique<Pair>(implementations[i], vendor, domain, bytes));
    cell.failure = pairs.back()->start();
    if (!cell.failure.empty()) return cell;
  }
  const bool quick = settings().quick;
  const auto paced =
      std::max<std::uint32_t>(2, static_cast<std::uint32_t>(rate(bytes) * (quick ? 0.05 : turn_seconds)));
  const std::uint32_t flat_out = quick ? 20 : bytes <= 64'000 ? 1000 : bytes <= 1'000'000 ? 100 : 30;
  for (int turn = 0; turn < (quick ? 1 : turns); ++turn) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      Pair::Figures figures;
      cell.failure = pairs[i]->run(paced, static_cast<std::int64_t>(1e9 / rate(bytes)), figures);
      if (!cell.failure.empty()) return cell;
      add(cell.figures[i], figures);
    }
    if (turn % 2 != 0) continue;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      Pair::Figures figures;
      cell.failure = pairs[i]->run(flat_out, 0, figures);
      if (!cell.failure.empty()) return cell;
      const double seconds = static_cast<double>(figures.receiver.last_ns - figures.receiver.first_ns) * 1e-9;
      if (seconds > 0) {
        cell.figures[i].messages_per_second.push_back(static_cast<double>(figures.receiver.messages - 1) / seconds);
      }
    }
  }
  return cell;
}

// The goal: at most 5 % or 5 us more than bare, whichever is larger.
const char* verdict(double ours, double bare) {
  return ours - bare <= std::max(5.0, 0.05 * bare) ? "met" : "MISSED";
}

void print(const std::string& vendor, std::size_t bytes, const Cell& cell) {
  static bool head = false;
  if (!std::exchange(head, true)) {
    print_later(
        "\nTwo processes, reliable, keep last 10, one way   p50 us    p99 us  CPU us/message  handled/sent "
        " alloc/msg  flat out MB/s\n");
  }
  const Figures& ours = cell.figures[0];
  const Figures& bare = cell.figures[1];
  for (std::size_t i = 0; i < implementations.size(); ++i) {
    const Figures& f = cell.figures[i];
    print_later("%-10s %5s  %-28s %8.1f  %8.1f  %14.1f  %7lu/%-5lu  %8.2f  %12.1f\n", vendor.c_str(),
                size_name(bytes).c_str(), implementations[i], quantile(f.latency_us, 0.5), quantile(f.latency_us, 0.99),
                f.cpu_per_message(), static_cast<unsigned long>(f.handled), static_cast<unsigned long>(f.sent),
                f.allocations_per_message(), quantile(f.messages_per_second, 0.5) * static_cast<double>(bytes) * 1e-6);
  }
  const double p50 = quantile(ours.latency_us, 0.5), bare_p50 = quantile(bare.latency_us, 0.5);
  print_later("%-10s %5s  runtime / bare: p50 %.2f (%+.1f us, %s), CPU %.2f (%+.1f us, %s)\n", vendor.c_str(),
              size_name(bytes).c_str(), p50 / bare_p50, p50 - bare_p50, verdict(p50, bare_p50),
              ours.cpu_per_message() / bare.cpu_per_message(), ours.cpu_per_message() - bare.cpu_per_message(),
              verdict(ours.cpu_per_message(), bare.cpu_per_message()));
}

const Cell& measured(const std::string& vendor, std::size_t bytes) {
  static std::map<std::pair<std::string, std::size_t>, Cell> cells;
  const auto [found, fresh] = cells.try_emplace({vendor, bytes});
  if (fresh) {
    found->second = measure(vendor, bytes);
    if (found->second.failure.empty()) print(vendor, bytes, found->second);
  }
  return found->second;
}

void report(benchmark::State& state, const std::string& vendor, std::size_t bytes, std::size_t implementation) {
  const Cell& cell = measured(vendor, bytes);
  if (!cell.failure.empty()) return fail(state, cell.failure);
  const Figures& figures = cell.figures[implementation];
  for (auto _ : state) state.SetIterationTime(quantile(figures.latency_us, 0.5) * 1e-6);
  state.counters["p99_us"] = quantile(figures.latency_us, 0.99);
  state.counters["cpu_us"] = figures.cpu_per_message();
  state.counters["sent"] = static_cast<double>(figures.sent);
  state.counters["handled"] = static_cast<double>(figures.handled);
  state.counters["flat_out_per_s"] = quantile(figures.messages_per_second, 0.5);
  if (implementation == 0) {
    state.counters["allocations"] = figures.allocations_per_message();
    if (figures.copied > 0) fail(state, "received blobs were copied");
  }
}

}  // namespace

void register_two_process() {
  for (const std::string_view vendor : built_in_vendors()) {
    for (const std::size_t bytes : sizes) {
      if (settings().quick && bytes != 1'000 && bytes != 1'000'000) continue;
      for (std::size_t i = 0; i < implementations.size(); ++i) {
        const std::string name =
            "two_process/" + std::string(vendor) + "/" + std::to_string(bytes) + "/" + implementations[i];
        benchmark::RegisterBenchmark(name.c_str(), report, std::string(vendor), bytes, i)
            ->UseManualTime()
            ->Iterations(1)
            ->Unit(benchmark::kMicrosecond);
      }
    }
  }
}

}  // namespace adit::bench
