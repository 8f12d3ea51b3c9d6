// Counter-based random numbers: a value depends only on (seed, sensor, frame, index), never on the order in which
// threads ask for it. Mixing function: the finalizer of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom
// number generators", OOPSLA 2014).
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

namespace adit::tunnel_simulator {

constexpr std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

constexpr std::uint64_t mix(std::uint64_t a, std::uint64_t b) {
  return mix(mix(a) ^ b);
}

// One independent stream of indexed numbers.
class RandomStream {
 public:
  RandomStream() = default;
  RandomStream(std::uint64_t seed, std::uint64_t purpose, std::uint64_t frame = 0)
      : key_(mix(mix(seed, purpose), frame)) {}

  std::uint64_t bits(std::uint64_t index) const { return mix(key_ + index * 0xd1342543de82ef95ULL); }

  // In (0, 1).
  double uniform(std::uint64_t index) const { return (static_cast<double>(bits(index) >> 11) + 0.5) * 0x1p-53; }
  double uniform(std::uint64_t index, double low, double high) const { return low + (high - low) * uniform(index); }

  // Two independent standard normal numbers from one index (Box-Muller).
  std::pair<float, float> normal_pair(std::uint64_t index) const {
    const std::uint64_t b = bits(index);
    const float u = (static_cast<float>(b >> 40) + 0.5F) * 0x1p-24F;
    const float angle = static_cast<float>((b >> 8) & 0xffffffU) * (2.0F * std::numbers::pi_v<float> * 0x1p-24F);
    const float radius = std::sqrt(-2.0F * std::log(u));
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }
  double normal(std::uint64_t index) const { return normal_pair(index).first; }

 private:
  std::uint64_t key_ = 0;
};

}  // namespace adit::tunnel_simulator
