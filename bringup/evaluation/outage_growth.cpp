#include "bringup/evaluation/outage_growth.hpp"

#include <algorithm>
#include <cstdlib>

namespace adit::evaluation {
namespace {

const Sample* nearest(const std::vector<Sample>& samples, std::int64_t stamp_ns) {
  constexpr std::int64_t farthest = 50'000'000;
  const auto away = [&](const Sample& s) { return std::llabs(s.stamp_ns - stamp_ns); };
  const auto after = std::lower_bound(samples.begin(), samples.end(), stamp_ns,
                                      [](const Sample& s, std::int64_t t) { return s.stamp_ns < t; });
  const Sample* best = after == samples.end() ? nullptr : &*after;
  if (after != samples.begin() && (!best || away(*std::prev(after)) < away(*best))) best = &*std::prev(after);
  return best && away(*best) <= farthest ? best : nullptr;
}

}  // namespace

std::vector<OutageGrowth> outage_growth(const Evaluation& evaluation,
                                        std::span<const std::pair<std::int64_t, std::int64_t>> outages_ns) {
  std::vector<OutageGrowth> out;
  for (std::size_t i = 0; i < outages_ns.size(); ++i) {
    const auto seen = outages_ns.first(i);
    if (std::find(seen.begin(), seen.end(), outages_ns[i]) != seen.end()) continue;  // of two sensors at once
    const auto [from_ns, to_ns] = outages_ns[i];
    const Sample* const start = nearest(evaluation.samples, from_ns);
    const Sample* const end = nearest(evaluation.samples, to_ns);
    if (!start || !end || start == end) continue;
    const Pose estimated = start->estimate.inverse() * end->estimate, truth = start->truth.inverse() * end->truth;
    out.push_back({from_ns, to_ns, (estimated.translation() - truth.translation()).head<2>().norm(),
                   end->distance_m - start->distance_m});
  }
  return out;
}

}  // namespace adit::evaluation
