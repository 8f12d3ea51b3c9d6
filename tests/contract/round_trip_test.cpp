// Samples of every size arrive, equal to the byte, with their times, writer and sequence numbers.
#include "tests/contract/contract.hpp"

namespace adit::contract {
namespace {

class RoundTrip : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, RoundTrip, testing::ValuesIn(all_pairs()), name_of);

TEST_P(RoundTrip, EverySizeArrivesEqual) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  Collector collector(*link.reader);
  std::uint64_t number = 0;
  for (const std::size_t size : {64u, 1u << 10, 64u << 10, 1u << 20, 4u << 20, 13u, 1021u, 65537u}) {
    collector.samples.clear();
    const auto sent = link.writer->publish(Payload(size, ++number));
    ASSERT_TRUE(sent) << sent.error().message;
    ASSERT_TRUE(collector.wait_for(1)) << size << " bytes";
    EXPECT_EQ(number_in(collector.samples[0].bytes()), number);
    EXPECT_TRUE(is_intact(collector.samples[0].bytes(), size)) << size << " bytes";
  }
  const LinkStats writer = link.writer->stats();
  const LinkStats reader = link.reader->stats();
  EXPECT_EQ(writer.sent, number);
  EXPECT_EQ(writer.send_failed, 0u);
  EXPECT_EQ(reader.received, number);
  EXPECT_EQ(reader.lost, 0u);
  EXPECT_EQ(reader.rejected, 0u);
  EXPECT_GE(reader.received_bytes, 5u << 20);
}

TEST_P(RoundTrip, InfoNamesTimeWriterAndSequence) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  Collector collector(*link.reader);
  const Time stamp(123456789s + 250ms);
  const Time before = system_now();
  for (unsigned n = 1; n <= 3; ++n) ASSERT_TRUE(link.writer->publish(Payload(64, n), stamp + std::chrono::seconds(n)));
  ASSERT_TRUE(collector.wait_for(3));
  for (unsigned n = 1; n <= 3; ++n) {
    const MessageInfo& info = collector.samples[n - 1].info();
    EXPECT_EQ(info.sequence, n);
    EXPECT_EQ(info.writer, link.writer->gid()) << to_string(info.writer) << " " << to_string(link.writer->gid());
    // RTPS carries fractions of 2^-32 s.
    EXPECT_LT(std::chrono::abs(info.source_time - (stamp + std::chrono::seconds(n))), 2ns);
    EXPECT_GE(info.received_time, before);
    EXPECT_LE(info.received_time, system_now());
  }
}

TEST_P(RoundTrip, ForwardSendsBytesAsTheyAre) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  Collector collector(*link.reader);
  const std::vector<std::byte> bytes = Payload(1000, 77).bytes();
  ASSERT_TRUE(link.writer->forward(bytes));
  ASSERT_TRUE(collector.wait_for(1));
  EXPECT_TRUE(is_intact(collector.samples[0].bytes(), 1000));
  EXPECT_EQ(number_in(collector.samples[0].bytes()), 77u);
  const std::byte no_cdr[8] = {std::byte{0xff}, std::byte{0xff}};
  EXPECT_FALSE(link.writer->forward(no_cdr));
  EXPECT_EQ(link.writer->stats().send_failed, 1u);
}

}  // namespace
}  // namespace adit::contract
