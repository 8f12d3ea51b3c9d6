// adit_bench: all benchmarks of the foundation. Flags of Google Benchmark, and
//   --quick                        a few messages a cell: shows that everything still runs
//   --talker=VENDOR:NAME:PROGRAM   one more program whose start, memory and size are measured (may be repeated)
#include <unistd.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>

#include "tests/benchmarks/bench.hpp"
#include "tests/benchmarks/board.hpp"

namespace adit::bench {
namespace {

bool failed = false;
std::string tables;

}  // namespace

Settings& settings() {
  static Settings instance;
  return instance;
}

std::string size_name(std::size_t bytes) {
  if (bytes >= 1'000'000) return std::to_string(bytes / 1'000'000) + " MB";
  if (bytes >= 1'000) return std::to_string(bytes / 1'000) + " KB";
  return std::to_string(bytes) + " B";
}

std::uint32_t private_domain() {
  return 20 + static_cast<std::uint32_t>(getpid()) % 26 * 3;
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(q * static_cast<double>(values.size())))];
}

void fail(benchmark::State& state, const std::string& reason) {
  failed = true;
  state.SkipWithError(reason.c_str());
}

bool anything_failed() {
  return failed;
}

void print_later(const char* format, ...) {
  char line[400];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  tables += line;
}

void print_tables() {
  std::fputs(tables.c_str(), stderr);
}

namespace {

bool add_talker(const std::string& text) {
  const std::size_t first = text.find(':'), second = text.find(':', first + 1);
  if (first == std::string::npos || second == std::string::npos) return false;
  settings().talkers.push_back(
      {text.substr(0, first), text.substr(first + 1, second - first - 1), text.substr(second + 1)});
  return true;
}

int run(int argc, char** argv) {
  std::vector<char*> rest;
  for (int i = 0; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--quick") {
      settings().quick = true;
    } else if (word.starts_with("--talker=")) {
      if (!add_talker(word.substr(9))) {
        std::fprintf(stderr, "%s: give --talker=VENDOR:NAME:PROGRAM\n", word.c_str());
        return 2;
      }
    } else {
      rest.push_back(argv[i]);
    }
  }
  char quick_time[] = "--benchmark_min_time=0.01";
  if (settings().quick) rest.push_back(quick_time);
  int count = static_cast<int>(rest.size());
  rest.push_back(nullptr);
  benchmark::Initialize(&count, rest.data());
  if (benchmark::ReportUnrecognizedArguments(count, rest.data())) return 2;
  register_codec();
  register_same_process();
  register_two_process();
  register_talkers();
  benchmark::RunSpecifiedBenchmarks();
  print_tables();
  return anything_failed() ? 1 : 0;
}

}  // namespace
}  // namespace adit::bench

int main(int argc, char** argv) {
  if (argc == 8 && std::strcmp(argv[1], "--peer") == 0) {
    const adit::bench::Peer peer{argv[2], argv[3], argv[4], static_cast<std::uint32_t>(std::stoul(argv[5])),
                                 std::stoul(argv[6])};
    return adit::bench::run_peer(peer, std::stoi(argv[7]));
  }
  return adit::bench::run(argc, argv);
}
