// What a reliable writer publishes from the moment it knows of a reader on arrives, however large; with small buffers
// it arrives or is counted.
#include <cstdio>
#include <thread>

#include "tests/contract/contract.hpp"

namespace adit::contract {
namespace {

class Delivery : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Delivery, testing::ValuesIn(all_pairs()), name_of);

std::vector<std::uint64_t> numbers(const std::vector<Sample>& samples) {
  std::vector<std::uint64_t> all;
  for (const Sample& sample : samples) all.push_back(number_in(sample.bytes()));
  return all;
}

std::unique_ptr<Participant> open_with_buffers(const Contract& test, const std::string& vendor, std::size_t bytes) {
  ParticipantConfig config = test.participant_config(vendor);
  config.socket_buffer_bytes = bytes;
  auto participant = open(config);
  EXPECT_TRUE(participant);
  return participant ? std::move(*participant) : nullptr;
}

struct Arrived {
  std::vector<std::uint64_t> numbers;
  std::uint64_t lost = 0;  // as the reader counts it
};

// What arrives of `count` samples, one each `period`, the first at the moment the writer has its match.
Arrived publish_at_once(Contract& test, const Pair& pair, std::size_t buffers, std::size_t size, unsigned count,
                        Duration period) {
  const auto writer_side = open_with_buffers(test, pair.writer, buffers);
  const auto reader_side = open_with_buffers(test, pair.reader, buffers);
  if (!writer_side || !reader_side) return {};
  const auto writer = make_writer(*writer_side, test.endpoint("delivery", Qos::reliable(10)));
  const auto reader = make_reader(*reader_side, test.endpoint("delivery", Qos::reliable(10)));
  Collector collector(*reader);
  EXPECT_TRUE(wait_until([&] { return writer->stats().matched > 0; }));
  auto next = std::chrono::steady_clock::now();
  for (unsigned n = 1; n <= count; ++n) {
    EXPECT_TRUE(writer->publish(Payload(size, n)));
    next += period;
    while (collector.samples.size() < n && std::chrono::steady_clock::now() < next) collector.wait_for(n, 1ms);
    std::this_thread::sleep_until(next);
  }
  const auto complete = [&] {
    return !collector.samples.empty() && number_in(collector.samples.back().bytes()) == count;
  };
  for (int i = 0; i < 100 && !complete(); ++i) collector.wait_for(count, 100ms);
  return {numbers(collector.samples), reader->stats().lost};
}

std::vector<std::uint64_t> from_to(std::uint64_t first, std::uint64_t last) {
  std::vector<std::uint64_t> all;
  for (std::uint64_t n = first; n <= last; ++n) all.push_back(n);
  return all;
}

constexpr std::size_t usual = 4 << 20;
constexpr std::size_t stock = 212992;  // what the kernel grants where nobody has raised net.core.rmem_max

TEST_P(Delivery, SmallSamplesFromTheMomentOfTheMatch) {
  EXPECT_EQ(publish_at_once(*this, GetParam(), usual, 100, 5, 2ms).numbers, from_to(1, 5));
}

TEST_P(Delivery, LargeSamplesFromTheMomentOfTheMatch) {
  for (int round = 0; round < 5; ++round) {
    EXPECT_EQ(publish_at_once(*this, GetParam(), usual, 1'000'000, 5, 20ms).numbers, from_to(1, 5))
        << "round " << round;
  }
}

// Most of a cloud does not fit and is repaired piece by piece. Where repair cannot keep up, the writer goes on to what
// is newer; what it still keeps when it stops has to arrive, and what is missing before is counted.
TEST_P(Delivery, CloudsThroughStockKernelBuffersArriveOrAreCounted) {
  constexpr std::uint64_t count = 20, kept = 10;
  const auto [numbers, lost] = publish_at_once(*this, GetParam(), stock, 4'000'000, count, 100ms);
  ASSERT_GE(numbers.size(), kept);
  EXPECT_EQ(std::vector(numbers.end() - kept, numbers.end()), from_to(count - kept + 1, count));
  EXPECT_EQ(lost, numbers.back() - numbers.front() + 1 - numbers.size());
  std::printf("%zu of %zu, %zu counted as lost\n", numbers.size(), std::size_t{count}, static_cast<std::size_t>(lost));
}

}  // namespace
}  // namespace adit::contract
