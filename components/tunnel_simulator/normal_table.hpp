// Standard normal numbers by table: four from one 64-bit random word.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace adit::tunnel_simulator {

// The quantiles of the normal distribution at 65536 equally likely levels, scaled to unit variance; beyond 4.3 sigma
// there is nothing. One table for the program, made at first use; any thread.
class NormalTable {
 public:
  static const NormalTable& instance();
  // From any 16 bits of a random word.
  float at(std::uint64_t bits) const { return values_[bits & 0xffffU]; }
  std::array<float, 4> four(std::uint64_t bits) const {
    return {at(bits), at(bits >> 16), at(bits >> 32), at(bits >> 48)};
  }

 private:
  NormalTable();
  std::vector<float> values_;
};

}  // namespace adit::tunnel_simulator
