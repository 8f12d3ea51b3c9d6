#include "components/thermal_odometry/place_index.hpp"

#include <algorithm>

namespace adit::thermal_odometry {
namespace {
constexpr std::size_t substring_bits = 16;
}

PlaceIndex::PlaceIndex() : newest_(tables << substring_bits, none) {}

std::size_t PlaceIndex::slot(const Descriptor& descriptor, std::size_t table) {
  const std::size_t bit = table * substring_bits;
  const std::uint64_t substring = descriptor[bit / 64] >> (bit % 64) & 0xFFFFU;
  return table << substring_bits | static_cast<std::size_t>(substring);
}

void PlaceIndex::add(std::span<const Descriptor> descriptors) {
  for (const Descriptor& descriptor : descriptors) {
    Entry entry{descriptor, places_, {}};
    for (std::size_t t = 0; t < tables; ++t) {
      std::uint32_t& newest = newest_[slot(descriptor, t)];
      entry.next[t] = newest;
      newest = static_cast<std::uint32_t>(entries_.size());
    }
    entries_.push_back(entry);
  }
  ++places_;
}

std::vector<PlaceIndex::Votes> PlaceIndex::query(std::span<const Descriptor> descriptors, std::uint32_t end,
                                                 std::size_t wanted) const {
  end = std::min(end, places_);
  std::vector<int> counts(end, 0);
  std::vector<std::size_t> voter(end, 0);  // the last descriptor that voted, plus one: each votes once for a place
  for (std::size_t d = 0; d < descriptors.size(); ++d) {
    for (std::size_t t = 0; t < tables; ++t) {
      for (std::uint32_t e = newest_[slot(descriptors[d], t)]; e != none; e = entries_[e].next[t]) {
        const Entry& entry = entries_[e];
        if (entry.place >= end || voter[entry.place] == d + 1) continue;
        if (hamming(descriptors[d], entry.descriptor) > max_distance) continue;
        voter[entry.place] = d + 1;
        ++counts[entry.place];
      }
    }
  }
  std::vector<Votes> best;
  for (std::uint32_t p = 0; p < end; ++p) {
    if (counts[p] > 0) best.push_back({p, counts[p]});
  }
  const auto more = [](const Votes& a, const Votes& b) {
    return a.count != b.count ? a.count > b.count : a.place < b.place;
  };
  const auto middle = best.begin() + static_cast<std::ptrdiff_t>(std::min(wanted, best.size()));
  std::partial_sort(best.begin(), middle, best.end(), more);
  best.erase(middle, best.end());
  return best;
}

}  // namespace adit::thermal_odometry
