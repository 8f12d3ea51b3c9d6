// What an outage costs: the error of the motion between its start and its end, whatever error was there before.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"

namespace adit::evaluation {

struct OutageGrowth {
  std::int64_t from_ns = 0, to_ns = 0;
  double error_m = 0.0;     // horizontal, of the estimated motion against the true one
  double distance_m = 0.0;  // the truth's way meanwhile
};

// One entry for each different span in which the estimate never stopped: with a sample within 50 ms of both ends.
std::vector<OutageGrowth> outage_growth(const Evaluation& evaluation,
                                        std::span<const std::pair<std::int64_t, std::int64_t>> outages_ns);

}  // namespace adit::evaluation
