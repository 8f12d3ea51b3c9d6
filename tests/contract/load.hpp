// A paced stream of samples over one link, and what became of it.
#pragma once

#include "tests/contract/contract.hpp"

namespace adit::contract {

constexpr std::size_t cloud = 4u << 20;  // bytes of a large point cloud

struct LoadFigures {
  std::uint64_t sent = 0;
  std::size_t received = 0;
  std::size_t damaged = 0;
  std::vector<double> latency_ms;  // publish to arrival, sorted
  LinkStats reader;
};

// Publishes `count` samples of `size` bytes at `rate` per second and takes them on a thread of its own.
LoadFigures run_load(Link& link, std::size_t size, unsigned count, double rate);
// Prints the figures; fails the test when anything was lost, damaged or refused.
void expect_nothing_lost(const LoadFigures& figures, unsigned count, const std::string& what);

}  // namespace adit::contract
