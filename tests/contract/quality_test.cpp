// QoS: history for late joiners, overwriting, what matches, and the report when it does not.
#include "tests/contract/contract.hpp"

namespace adit::contract {
namespace {

class Quality : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Quality, testing::ValuesIn(all_pairs()), name_of);

std::vector<std::uint64_t> numbers(const std::vector<Sample>& samples) {
  std::vector<std::uint64_t> all;
  for (const Sample& sample : samples) all.push_back(number_in(sample.bytes()));
  return all;
}

// What a reader that joins after `sent` samples gets of a writer that keeps `depth`.
std::vector<std::uint64_t> late_join(Contract& test, const Pair& pair, std::uint32_t depth, unsigned sent) {
  const auto writer_side = test.open_one(pair.writer);
  const auto reader_side = test.open_one(pair.reader);
  const auto writer = make_writer(*writer_side, test.endpoint("latched", Qos::latched(depth)));
  for (unsigned n = 1; n <= sent; ++n) EXPECT_TRUE(writer->publish(Payload(1000, n)));
  const auto reader = make_reader(*reader_side, test.endpoint("latched", Qos::latched(100)));
  Collector collector(*reader);
  EXPECT_TRUE(collector.wait_for(std::min(depth, sent)));
  EXPECT_EQ(reader->stats().lost, 0u);
  return numbers(collector.samples);
}

TEST_P(Quality, LateJoinerGetsTheLastSample) {
  EXPECT_THAT(late_join(*this, GetParam(), 1, 3), testing::ElementsAre(3));
}

TEST_P(Quality, LateJoinerGetsAllThatTheWriterKeeps) {
  EXPECT_THAT(late_join(*this, GetParam(), 5, 8), testing::ElementsAre(4, 5, 6, 7, 8));
}

TEST_P(Quality, LateJoinerOfAVolatileWriterGetsNothingOld) {
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  const auto writer = make_writer(*writer_side, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(writer->publish(Payload(64, 1)));
  const auto reader = make_reader(*reader_side, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_for_match(*writer, *reader));
  ASSERT_TRUE(writer->publish(Payload(64, 2)));
  Collector collector(*reader);
  ASSERT_TRUE(collector.wait_for(1));
  EXPECT_THAT(numbers(collector.samples), testing::ElementsAre(2));
  EXPECT_EQ(reader->stats().lost, 0u);
}

TEST_P(Quality, StrongerOfferServesWeakerRequest) {
  Link link(*this, GetParam(), Qos::latched(10), Qos::sensor());
  ASSERT_TRUE(link.reader && link.writer);
  Collector collector(*link.reader);
  for (unsigned n = 1; n <= 3; ++n) {
    ASSERT_TRUE(link.writer->publish(Payload(64, n)));
    ASSERT_TRUE(collector.wait_for(n));
  }
  EXPECT_THAT(numbers(collector.samples), testing::ElementsAre(1, 2, 3));
}

TEST_P(Quality, BestEffortWorksBothWays) {
  Link link(*this, GetParam(), Qos::sensor(), Qos::sensor());
  ASSERT_TRUE(link.reader && link.writer);
  Collector collector(*link.reader);
  for (unsigned n = 1; n <= 20; ++n) {
    ASSERT_TRUE(link.writer->publish(Payload(1024, n)));
    ASSERT_TRUE(collector.wait_for(n)) << n;
  }
  EXPECT_EQ(link.reader->stats().lost, 0u);
}

TEST_P(Quality, OverwrittenSamplesAreCounted) {
  Link link(*this, GetParam(), Qos::reliable(100), Qos::reliable(3));
  ASSERT_TRUE(link.reader && link.writer);
  for (unsigned n = 1; n <= 10; ++n) ASSERT_TRUE(link.writer->publish(Payload(64, n)));
  const auto acknowledged = link.writer->wait_for_acknowledgements(10s);
  ASSERT_TRUE(acknowledged) << acknowledged.error().message;
  // Acknowledged is received by the middleware, which may still be on its way into the cache.
  EXPECT_TRUE(wait_until([&] { return link.reader->stats().overwritten == 7; }));
  Sample samples[10];
  ASSERT_EQ(link.reader->take(samples), 3u);
  EXPECT_EQ(number_in(samples[0].bytes()), 8u);
  EXPECT_EQ(number_in(samples[2].bytes()), 10u);
  const LinkStats stats = link.reader->stats();
  EXPECT_EQ(stats.received, 3u);
  EXPECT_EQ(stats.overwritten, 7u);
  EXPECT_EQ(stats.lost, 0u);
}

std::vector<std::string> policies(const Event& event) {
  std::vector<std::string> names;
  for (const Mismatch& mismatch : event.mismatches) names.push_back(mismatch.policy);
  return names;
}

TEST_P(Quality, MismatchIsReportedInFullOnBothSides) {
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  const EventLog writer_log(*writer_side);
  const EventLog reader_log(*reader_side);
  Qos offered = Qos::sensor();
  offered.deadline = 200ms;
  Qos requested = Qos::latched();
  requested.deadline = 100ms;
  requested.liveliness = Qos::Liveliness::manual_by_topic;
  requested.lease = 1s;
  const auto writer = make_writer(*writer_side, endpoint("contract", offered));
  const auto reader = make_reader(*reader_side, endpoint("contract", requested));
  ASSERT_TRUE(writer_log.wait_for(Event::Kind::qos_mismatch));
  ASSERT_TRUE(reader_log.wait_for(Event::Kind::qos_mismatch));

  for (const bool at_writer : {true, false}) {
    const Event event = (at_writer ? writer_log : reader_log).of(Event::Kind::qos_mismatch).front();
    EXPECT_THAT(policies(event),
                testing::ElementsAre("reliability", "durability", "deadline", "liveliness", "liveliness lease"));
    EXPECT_EQ(event.is_writer, at_writer);
    EXPECT_EQ(event.topic, "contract");
    EXPECT_EQ(event.local, at_writer ? writer->gid() : reader->gid());
    EXPECT_EQ(event.remote, at_writer ? reader->gid() : writer->gid());
    EXPECT_THAT(event.text, testing::AllOf(testing::HasSubstr("offered best effort, requested reliable"),
                                           testing::HasSubstr("offered 200 ms, requested 100 ms"),
                                           testing::HasSubstr("make the writer reliable")));
    ASSERT_FALSE(event.mismatches.empty());
    EXPECT_EQ(event.mismatches[2].offered, "200 ms");
    EXPECT_EQ(event.mismatches[2].requested, "100 ms");
  }
  EXPECT_EQ(writer->stats().matched, 0u);
  EXPECT_EQ(reader->stats().matched, 0u);
}

TEST_P(Quality, MissedDeadlineIsReported) {
  Qos qos = Qos::reliable();
  qos.deadline = 50ms;
  Link link(*this, GetParam(), qos, qos);
  ASSERT_TRUE(link.reader && link.writer);
  const EventLog reader_log(*link.reader_side);
  ASSERT_TRUE(link.writer->publish(Payload(64, 1)));
  ASSERT_TRUE(reader_log.wait_for(Event::Kind::deadline_missed));
  const Event event = reader_log.of(Event::Kind::deadline_missed).front();
  EXPECT_FALSE(event.is_writer);
  EXPECT_EQ(event.local, link.reader->gid());
  EXPECT_FALSE(event.text.empty());
}

TEST_P(Quality, ExpiredSamplesAreNotDelivered) {
  Qos qos = Qos::latched(10);
  qos.lifespan = 1s;
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  const auto writer = make_writer(*writer_side, endpoint("contract", qos));
  ASSERT_TRUE(writer->publish(Payload(64, 1)));
  const auto expired = std::chrono::steady_clock::now() + 1200ms;
  ASSERT_TRUE(wait_until([&] { return std::chrono::steady_clock::now() > expired; }));
  const auto reader = make_reader(*reader_side, endpoint("contract", Qos::latched(10)));
  ASSERT_TRUE(wait_for_match(*writer, *reader));
  ASSERT_TRUE(writer->publish(Payload(64, 2)));
  Collector collector(*reader);
  ASSERT_TRUE(collector.wait_for(1));
  EXPECT_THAT(numbers(collector.samples), testing::ElementsAre(2));
}

TEST_P(Quality, InvalidQosIsRefused) {
  const auto participant = open_one(GetParam().writer);
  Qos qos;
  qos.deadline = Duration::zero();
  const auto writer = participant->writer(endpoint("contract", qos));
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error().code, ErrorCode::invalid_argument);
  EXPECT_FALSE(participant->reader(endpoint("contract", qos)));
}

}  // namespace
}  // namespace adit::contract
