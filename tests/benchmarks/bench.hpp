// What the parts of adit_bench share: settings from the command line, size names, and the tables printed at the end.
#pragma once

#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace adit::bench {

// A talker program to measure: starts, publishes std_msgs/String on /chatter, ends. Called with SECONDS DOMAIN HERTZ.
struct Talker {
  std::string vendor;  // whose listener hears it, and its ADIT_MIDDLEWARE
  std::string name;    // "minimal", "bare"
  std::string path;
};

struct Settings {
  bool quick = false;  // a few messages a cell: shows that everything runs, measures nothing
  std::vector<Talker> talkers;
};
Settings& settings();

inline constexpr std::array<std::size_t, 5> sizes = {64, 1'000, 64'000, 1'000'000, 4'000'000};
std::string size_name(std::size_t bytes);  // "64 B", "4 MB"
// Domains that nobody else on this host uses, if only the program's process id can tell: 20 to 98, three in a row.
std::uint32_t private_domain();

double quantile(std::vector<double> values, double q);

// A failed measurement: shown by Google Benchmark, and the program's exit code.
void fail(benchmark::State& state, const std::string& reason);
bool anything_failed();

// printf into the tables that follow the output of Google Benchmark.
[[gnu::format(printf, 1, 2)]] void print_later(const char* format, ...);
void print_tables();

void register_codec();
void register_same_process();
void register_two_process();
void register_talkers();

}  // namespace adit::bench
