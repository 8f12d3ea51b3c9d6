// Which places have been seen before, by their binary descriptors alone: nothing is trained, no vocabulary file. Votes
// of descriptors that agree in one of 16 substrings and are near in Hamming distance (Norouzi, Punjani, Fleet, "Fast
// search in Hamming space with multi-index hashing", CVPR 2012, used as an approximate search).
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace adit::thermal_odometry {

// 256 binary tests of a patch, e.g. ORB.
using Descriptor = std::array<std::uint64_t, 4>;

inline int hamming(const Descriptor& a, const Descriptor& b) {
  int distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) distance += std::popcount(a[i] ^ b[i]);
  return distance;
}

class PlaceIndex {
 public:
  // Bits. LDSO's bound for a match; at half of it nine descriptors in ten share a substring.
  static constexpr int max_distance = 50;

  PlaceIndex();
  // Places are numbered 0, 1, 2, ... in the order of the calls. About 100 bytes a descriptor, and 4 MB.
  void add(std::span<const Descriptor> descriptors);

  struct Votes {
    std::uint32_t place = 0;
    int count = 0;  // descriptors of the query that have a near one there
  };
  // The places before `end` with the most votes, best first; equal votes: the earlier place first.
  std::vector<Votes> query(std::span<const Descriptor> descriptors, std::uint32_t end, std::size_t wanted) const;

 private:
  static constexpr std::size_t tables = 16;
  static constexpr std::uint32_t none = 0xFFFFFFFFU;
  static std::size_t slot(const Descriptor& descriptor, std::size_t table);

  struct Entry {
    Descriptor descriptor;
    std::uint32_t place;
    std::array<std::uint32_t, tables> next;  // older entry with the same substring
  };
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> newest_;  // entry, by table and substring
  std::uint32_t places_ = 0;
};

}  // namespace adit::thermal_odometry
