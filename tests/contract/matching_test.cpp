// Who meets whom: matches come and go, topics and types are told apart, the graph shows it.
#include "tests/contract/contract.hpp"

namespace adit::contract {
namespace {

class Matching : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Matching, testing::ValuesIn(all_pairs()), name_of);

TEST_P(Matching, MatchAndUnmatchAreEvents) {
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  const EventLog writer_log(*writer_side);
  const EventLog reader_log(*reader_side);
  const auto writer = make_writer(*writer_side, endpoint("contract", Qos::reliable()));
  EXPECT_FALSE(writer->has_remote_readers());
  auto reader = make_reader(*reader_side, endpoint("contract", Qos::reliable()));
  const Gid reader_gid = reader->gid();
  ASSERT_TRUE(writer_log.wait_for(Event::Kind::matched));
  ASSERT_TRUE(reader_log.wait_for(Event::Kind::matched));
  EXPECT_TRUE(writer->has_remote_readers());
  const Event at_writer = writer_log.of(Event::Kind::matched).front();
  EXPECT_EQ(at_writer.topic, "contract");
  EXPECT_TRUE(at_writer.is_writer);
  EXPECT_EQ(at_writer.local, writer->gid());
  EXPECT_EQ(at_writer.remote, reader_gid);
  const Event at_reader = reader_log.of(Event::Kind::matched).front();
  EXPECT_FALSE(at_reader.is_writer);
  EXPECT_EQ(at_reader.remote, writer->gid());

  reader.reset();
  ASSERT_TRUE(writer_log.wait_for(Event::Kind::unmatched));
  EXPECT_EQ(writer_log.of(Event::Kind::unmatched).front().remote, reader_gid);
  EXPECT_EQ(writer->stats().matched, 0u);
  EXPECT_FALSE(writer->has_remote_readers());
}

TEST_P(Matching, ReadersKnownBeforeTheWriterAreMatchedReadersOfIt) {
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  const EventLog writer_log(*writer_side);
  const auto reader = make_reader(*reader_side, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_until([&] {
    const Graph graph = writer_side->graph();
    return std::any_of(graph.endpoints.begin(), graph.endpoints.end(),
                       [&](const EndpointInfo& endpoint) { return endpoint.gid == reader->gid(); });
  }));
  const auto writer = make_writer(*writer_side, endpoint("contract", Qos::reliable()));
  EXPECT_TRUE(wait_until([&] { return writer->has_remote_readers(); }));
  ASSERT_TRUE(writer_log.wait_for(Event::Kind::matched));
  EXPECT_EQ(writer_log.of(Event::Kind::matched).front().remote, reader->gid());
  EXPECT_EQ(writer_log.of(Event::Kind::matched).front().local, writer->gid());
}

TEST_P(Matching, LeavingParticipantIsSeenAndItsSuccessorMatches) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  const EventLog writer_log(*link.writer_side);
  for (int round = 0; round < 3; ++round) {
    link.reader.reset();
    link.reader_side.reset();
    ASSERT_TRUE(wait_until([&] { return link.writer->stats().matched == 0; })) << round;
    ASSERT_TRUE(writer_log.wait_for(Event::Kind::unmatched, static_cast<std::size_t>(round) + 1));
    ASSERT_TRUE(link.writer->publish(Payload(64, 99)));  // to nobody: succeeds, is gone
    link.reader_side = open_one(GetParam().reader);
    link.reader = make_reader(*link.reader_side, endpoint("contract", Qos::reliable()));
    ASSERT_TRUE(wait_for_match(*link.writer, *link.reader)) << round;
    Collector collector(*link.reader);
    ASSERT_TRUE(link.writer->publish(Payload(64, static_cast<std::uint64_t>(round))));
    ASSERT_TRUE(collector.wait_for(1)) << round;
    EXPECT_EQ(number_in(collector.samples[0].bytes()), static_cast<std::uint64_t>(round));
  }
}

TEST_P(Matching, RestartedWriterReachesTheReaderAgain) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  link.writer.reset();
  link.writer_side.reset();
  ASSERT_TRUE(wait_until([&] { return link.reader->stats().matched == 0; }));
  link.writer_side = open_one(GetParam().writer);
  link.writer = make_writer(*link.writer_side, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_for_match(*link.writer, *link.reader));
  Collector collector(*link.reader);
  ASSERT_TRUE(link.writer->publish(Payload(64, 5)));
  ASSERT_TRUE(collector.wait_for(1));
  EXPECT_EQ(link.reader->stats().lost, 0u);
}

TEST_P(Matching, IgnoreLocalKeepsAParticipantFromItself) {
  const auto participant = open_one(GetParam().writer);
  const auto elsewhere = open_one(GetParam().reader);
  EndpointConfig config = endpoint("contract", Qos::reliable());
  config.ignore_local = true;
  const auto writer = make_writer(*participant, config);
  const auto own_reader = make_reader(*participant, config);
  const auto other_reader = make_reader(*elsewhere, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_for_match(*writer, *other_reader));
  // What the writer matched so far may be its own participant's reader.
  ASSERT_TRUE(wait_until([&] { return writer->has_remote_readers(); }));
  Collector collector(*other_reader);
  for (unsigned n = 1; n <= 5; ++n) ASSERT_TRUE(writer->publish(Payload(64, n)));
  ASSERT_TRUE(collector.wait_for(5));
  Sample sample[1];
  EXPECT_EQ(own_reader->take(sample), 0u);
  EXPECT_EQ(own_reader->stats().received, 0u);
  EXPECT_EQ(own_reader->stats().lost, 0u);
}

TEST_P(Matching, WithoutIgnoreLocalAParticipantHearsItself) {
  const auto participant = open_one(GetParam().writer);
  const auto writer = make_writer(*participant, endpoint("contract", Qos::reliable()));
  const auto reader = make_reader(*participant, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_for_match(*writer, *reader));
  EXPECT_FALSE(writer->has_remote_readers());
  Collector collector(*reader);
  for (unsigned n = 1; n <= 3; ++n) ASSERT_TRUE(writer->publish(Payload(64, n)));
  ASSERT_TRUE(collector.wait_for(3));
  EXPECT_EQ(collector.samples[0].info().writer, writer->gid());
  EXPECT_EQ(collector.samples[2].info().sequence, 3u);
}

TEST_P(Matching, TwoTopicsOfOneTypeStayApart) {
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  const auto writer_a = make_writer(*writer_side, endpoint("a", Qos::reliable()));
  const auto writer_b = make_writer(*writer_side, endpoint("b", Qos::reliable()));
  const auto reader_a = make_reader(*reader_side, endpoint("a", Qos::reliable()));
  const auto reader_b = make_reader(*reader_side, endpoint("b", Qos::reliable()));
  ASSERT_TRUE(wait_for_match(*writer_a, *reader_a));
  ASSERT_TRUE(wait_for_match(*writer_b, *reader_b));
  Collector at_a(*reader_a);
  Collector at_b(*reader_b);
  ASSERT_TRUE(writer_a->publish(Payload(64, 1)));
  ASSERT_TRUE(writer_b->publish(Payload(64, 2)));
  ASSERT_TRUE(at_a.wait_for(1));
  ASSERT_TRUE(at_b.wait_for(1));
  EXPECT_EQ(number_in(at_a.samples[0].bytes()), 1u);
  EXPECT_EQ(number_in(at_b.samples[0].bytes()), 2u);
  EXPECT_EQ(reader_a->stats().matched, 1u);
}

TEST_P(Matching, SeveralReadersOfOneTopicAllGetIt) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  const auto second = make_reader(*link.reader_side, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_until([&] { return link.writer->stats().matched == 2 && second->stats().matched == 1; }));
  Collector at_first(*link.reader);
  Collector at_second(*second);
  for (unsigned n = 1; n <= 3; ++n) ASSERT_TRUE(link.writer->publish(Payload(100000, n)));
  ASSERT_TRUE(at_first.wait_for(3));
  ASSERT_TRUE(at_second.wait_for(3));
  EXPECT_TRUE(is_intact(at_first.samples[2].bytes(), 100000));
  EXPECT_TRUE(is_intact(at_second.samples[2].bytes(), 100000));
}

TEST_P(Matching, SecondTypeOnATopicOfTheParticipantIsRefused) {
  const auto participant = open_one(GetParam().writer);
  auto writer = make_writer(*participant, endpoint("contract", Qos::reliable()));
  const auto refused = participant->reader(endpoint("contract", Qos::reliable(), other_type));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::incompatible);
  EXPECT_THAT(refused.error().message, testing::AllOf(testing::HasSubstr("contract"), testing::HasSubstr("Payload_"),
                                                      testing::HasSubstr("Other_")));
  writer.reset();
  EXPECT_TRUE(participant->reader(endpoint("contract", Qos::reliable(), other_type))) << "the topic is free again";
}

TEST_P(Matching, AnotherTypeOnTheTopicElsewhereDoesNotMatch) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  const auto stranger_side = open_one(GetParam().reader);
  const auto stranger = make_reader(*stranger_side, endpoint("contract", Qos::reliable(), other_type));
  // The graph of the stranger knows the writer, so that it had its chance to match.
  ASSERT_TRUE(wait_until([&] {
    for (const EndpointInfo& found : stranger_side->graph().endpoints) {
      if (found.gid == link.writer->gid()) return true;
    }
    return false;
  }));
  Collector collector(*link.reader);
  ASSERT_TRUE(link.writer->publish(Payload(64, 1)));
  ASSERT_TRUE(collector.wait_for(1));
  EXPECT_EQ(stranger->stats().matched, 0u);
  EXPECT_EQ(link.writer->stats().matched, 1u);
}

const EndpointInfo* find(const Graph& graph, const Gid& gid) {
  for (const EndpointInfo& endpoint : graph.endpoints) {
    if (endpoint.gid == gid) return &endpoint;
  }
  return nullptr;
}

TEST_P(Matching, GraphShowsEndpointsWithTypeQosAndHash) {
  const auto writer_side = open_one(GetParam().writer);
  const auto reader_side = open_one(GetParam().reader);
  EndpointConfig config = endpoint("contract", Qos::latched(7));
  config.qos.deadline = 1500ms;
  config.user_data = "typehash=" + std::string(payload_type.type_hash) + ";";
  const auto writer = make_writer(*writer_side, config);
  const auto reader = make_reader(*reader_side, endpoint("contract", Qos::sensor()));

  for (const bool at_writer : {true, false}) {
    const Participant& side = at_writer ? *writer_side : *reader_side;
    ASSERT_TRUE(wait_until([&] {
      const Graph graph = side.graph();
      return find(graph, writer->gid()) && find(graph, reader->gid()) && graph.participants.size() >= 2;
    })) << "graph of the "
        << (at_writer ? "writer" : "reader");
    const Graph graph = side.graph();
    const EndpointInfo& of_writer = *find(graph, writer->gid());
    EXPECT_TRUE(of_writer.is_writer);
    EXPECT_EQ(of_writer.dds_topic, "contract");
    EXPECT_EQ(of_writer.dds_type, payload_type.dds_name);
    EXPECT_EQ(of_writer.type_hash, payload_type.type_hash);
    EXPECT_EQ(of_writer.qos.reliability, Qos::Reliability::reliable);
    EXPECT_EQ(of_writer.qos.durability, Qos::Durability::transient_local);
    ASSERT_TRUE(of_writer.qos.deadline);
    EXPECT_LT(std::chrono::abs(*of_writer.qos.deadline - 1500ms), 10ns);
    EXPECT_EQ(of_writer.qos.depth, of_writer.history_known ? 7u : 0u);
    const EndpointInfo& of_reader = *find(graph, reader->gid());
    EXPECT_FALSE(of_reader.is_writer);
    EXPECT_EQ(of_reader.qos.reliability, Qos::Reliability::best_effort);
    EXPECT_EQ(of_reader.qos.durability, Qos::Durability::volatile_);

    int locals = 0;
    for (const ParticipantInfo& participant : graph.participants) {
      if (participant.local) {
        ++locals;
        EXPECT_EQ(participant.gid, side.gid());
      }
      const std::string vendor = participant.gid == writer_side->gid() ? GetParam().writer : GetParam().reader;
      EXPECT_EQ(participant.vendor, vendor == "fastdds" ? "Fast DDS" : "Cyclone DDS");
      EXPECT_EQ(participant.name, "contract");
    }
    EXPECT_EQ(locals, 1);
  }
}

TEST_P(Matching, GraphForgetsWhatIsGone) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  const Gid gid = link.reader->gid();
  EXPECT_TRUE(wait_until([&] { return find(link.writer_side->graph(), gid) != nullptr; }));
  link.reader.reset();
  EXPECT_TRUE(wait_until([&] { return find(link.writer_side->graph(), gid) == nullptr; }));
  link.reader_side.reset();
  EXPECT_TRUE(wait_until([&] { return link.writer_side->graph().participants.size() == 1; }));
}

}  // namespace
}  // namespace adit::contract
