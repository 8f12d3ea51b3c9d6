// A short fuzz run for the unit suite: pseudo-random mutations of valid samples, the same every time.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>

#include "idl/testing/allocation_counter.hpp"
#include "tests/fuzz/decode_property.hpp"
#include "tests/wire/shared_data.hpp"

namespace adit {
namespace {

namespace fs = std::filesystem;
using Payload = std::vector<std::byte>;

struct Seed {
  const MessageType* type;
  Payload payload;
};

// Default samples of every type, and the captured ones where there are any.
std::vector<Seed> seeds() {
  std::vector<Seed> all;
  for (const MessageType& type : all_types()) all.push_back({&type, type.default_sample()});
  const fs::path golden = test::shared_folder() / "golden";
  if (!fs::exists(golden)) return all;
  for (const auto& entry : fs::directory_iterator(golden)) {
    const std::string file = entry.path().filename();
    const std::size_t split = file.find("__");
    if (entry.path().extension() != ".cdr" || split == std::string::npos) continue;
    const std::string name = file.substr(0, split) + "/msg/" + file.substr(split + 2, file.find('.') - split - 2);
    std::ifstream stream(entry.path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    const MessageType* type = find_type(name);
    if (!type || bytes.size() > 20000) continue;
    const auto view = std::as_bytes(std::span(bytes));
    all.push_back({type, Payload(view.begin(), view.end())});
  }
  return all;
}

class Mutator {
 public:
  void mutate(Payload& payload) {
    for (std::size_t n = 1 + random_() % 4; n > 0; --n) mutate_once(payload);
  }
  std::size_t below(std::size_t limit) { return random_() % limit; }

 private:
  void mutate_once(Payload& payload) {
    static constexpr std::uint32_t interesting[] = {0,      1,       2,          7,          0xff,
                                                    0xffff, 0x10000, 0x7fffffff, 0x80000000, 0xffffffff};
    if (payload.empty()) return payload.push_back(std::byte{0});
    const std::size_t at = below(payload.size());
    switch (below(6)) {
      case 0:
        payload[at] ^= std::byte(1u << below(8));
        break;
      case 1:
        payload[at] = std::byte(random_());
        break;
      case 2:
        payload.resize(at);
        break;
      case 3:
        payload.insert(payload.begin() + static_cast<std::ptrdiff_t>(at), 1 + below(8), std::byte(random_()));
        break;
      case 4:
        payload[1] = std::byte(below(2));
        break;  // the other endianness
      default:
        if (payload.size() >= 8) {
          const std::size_t word = 4 + below(payload.size() - 7);
          std::memcpy(&payload[word / 4 * 4], &interesting[below(std::size(interesting))], 4);
        }
    }
  }
  std::mt19937 random_{20240611};
};

TEST(MutationFuzz, DecodersHoldTheirProperties) {
  constexpr int executions = 300000;
  const std::vector<Seed> all = seeds();
  Mutator mutator;
  int accepted = 0;
  Payload payload;
  for (int i = 0; i < executions; ++i) {
    const Seed& seed = all[mutator.below(all.size())];
    payload = seed.payload;
    mutator.mutate(payload);
    payload.shrink_to_fit();  // one byte too far is then seen by AddressSanitizer

    const std::uint64_t before = test::allocated_bytes_of_this_thread();
    Payload again;
    accepted += seed.type->reencode(payload, again) == DecodeStatus::ok;
    ASSERT_LE(test::allocated_bytes_of_this_thread() - before, test::allocation_limit(payload.size()))
        << seed.type->info->ros_name;
    ASSERT_EQ(test::check_decode(*seed.type, payload), "") << seed.type->info->ros_name << ", execution " << i;
  }
  std::cout << executions << " executions on " << all.size() << " seeds, " << accepted << " payloads accepted\n";
  EXPECT_GT(accepted, executions / 100);
  EXPECT_LT(accepted, executions * 9 / 10);
}

}  // namespace
}  // namespace adit
