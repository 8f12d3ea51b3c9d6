// What a participant is made from: refusals that say what to do, peers, and the account of what is in force.
#include "tests/contract/contract.hpp"

namespace adit::contract {
namespace {

class Configured : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Configured, testing::ValuesIn(all_pairs()), name_of);

TEST_P(Configured, DomainOutOfRangeIsRefused) {
  ParticipantConfig config = participant_config(GetParam().writer);
  config.domain = 233;
  const auto refused = open(config);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(refused.error().message, testing::AllOf(testing::HasSubstr("233"), testing::HasSubstr("232")));
}

TEST_P(Configured, UnknownInterfaceIsRefusedWithThoseThereAre) {
  ParticipantConfig config = participant_config(GetParam().writer);
  config.network = "nope0";
  const auto refused = open(config);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, testing::AllOf(testing::HasSubstr("nope0"), testing::HasSubstr("lo")));
}

TEST_P(Configured, HighestDomainWorks) {
  ParticipantConfig config = participant_config(GetParam().writer);
  config.domain = 232;
  const auto participant = open(config);
  ASSERT_TRUE(participant) << participant.error().message;
}

TEST_P(Configured, MissingKeystoreIsRefused) {
  ParticipantConfig config = participant_config(GetParam().writer);
  config.security = SecurityConfig{"/nonexistent/keystore", "/robot"};
  const auto refused = open(config);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("/nonexistent/keystore"));
}

TEST_P(Configured, LoopbackByAddressAndStaticPeersMeet) {
  ParticipantConfig first = participant_config(GetParam().writer);
  first.network = "127.0.0.1";
  ParticipantConfig second = participant_config(GetParam().reader);
  second.peers = {"127.0.0.1"};
  const auto writer_side = open(first);
  const auto reader_side = open(second);
  ASSERT_TRUE(writer_side) << writer_side.error().message;
  ASSERT_TRUE(reader_side) << reader_side.error().message;
  const auto writer = make_writer(**writer_side, endpoint("contract", Qos::reliable()));
  const auto reader = make_reader(**reader_side, endpoint("contract", Qos::reliable()));
  ASSERT_TRUE(wait_for_match(*writer, *reader));
}

TEST_P(Configured, OtherDomainsAreNotHeard) {
  const PrivateDomain elsewhere;
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  ParticipantConfig config = participant_config(GetParam().reader);
  config.domain = elsewhere.id();
  const auto stranger_side = open(config);
  ASSERT_TRUE(stranger_side);
  const auto stranger = make_reader(**stranger_side, endpoint("contract", Qos::reliable()));
  Collector collector(*link.reader);
  for (unsigned n = 1; n <= 5; ++n) ASSERT_TRUE(link.writer->publish(Payload(64, n)));
  ASSERT_TRUE(collector.wait_for(5));
  EXPECT_EQ(stranger->stats().matched, 0u);
  EXPECT_EQ((*stranger_side)->graph().participants.size(), 1u);
}

TEST_P(Configured, ExplainNamesBuffersNetworkAndDomain) {
  const auto participant = open_one(GetParam().writer);
  const std::string text = participant->explain();
  EXPECT_THAT(text, testing::AllOf(testing::HasSubstr("buffer"), testing::HasSubstr("127.0.0.1"),
                                   testing::HasSubstr("domain " + std::to_string(domain_.id()))));
}

TEST_P(Configured, EndpointWithoutNameOrTypeIsRefused) {
  const auto participant = open_one(GetParam().writer);
  EXPECT_FALSE(participant->writer(endpoint("", Qos::reliable())));
  EndpointConfig config = endpoint("contract", Qos::reliable());
  config.type = nullptr;
  EXPECT_FALSE(participant->reader(config));
}

TEST_P(Configured, ManyParticipantsOfBothVendorsInOneProcess) {
  std::vector<std::unique_ptr<Participant>> participants;
  for (int i = 0; i < 4; ++i) {
    participants.push_back(open_one(GetParam().writer));
    participants.push_back(open_one(GetParam().reader));
  }
  for (const auto& participant : participants) {
    EXPECT_TRUE(wait_until([&] { return participant->graph().participants.size() == participants.size(); }))
        << participant->graph().participants.size();
  }
}

}  // namespace
}  // namespace adit::contract
