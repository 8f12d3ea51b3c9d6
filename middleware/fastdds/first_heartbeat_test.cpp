#include "middleware/fastdds/first_heartbeat.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

namespace adit::fastdds {
namespace {

using ::testing::ElementsAreArray;

Gid gid(std::uint8_t vendor, std::uint8_t rest, std::uint8_t entity) {
  Gid gid;
  gid.bytes = {1, vendor, rest, rest, rest, rest, rest, rest, rest, rest, rest, rest, 0, 0, entity, 3};
  return gid;
}
const Gid writer = gid(0x0f, 7, 1), reader = gid(0x10, 9, 4);

// What a Cyclone DDS reader sends: INFO_DST, then an ACKNACK without a bitmap.
std::vector<std::uint8_t> question(std::uint8_t base, std::uint8_t bits = 0) {
  std::vector<std::uint8_t> out = {'R', 'T', 'P', 'S', 2, 1, 1, 0x10, 1, 0x10, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9};
  out.insert(out.end(), {0x0e, 1, 12, 0, 1, 0x0f, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7});
  const std::uint8_t length = bits > 0 ? 28 : 24;
  out.insert(out.end(), {0x06, 1, length, 0, 0, 0, 4, 3, 0, 0, 1, 3, 0, 0, 0, 0, base, 0, 0, 0, bits, 0, 0, 0});
  if (bits > 0) out.insert(out.end(), {0, 0, 0, 0x80});
  out.insert(out.end(), {1, 0, 0, 0});
  return out;
}

// A socket that stands for the reader.
class FirstHeartbeatTest : public ::testing::Test {
 protected:
  FirstHeartbeatTest() {
    socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address_), sizeof address_), 0);
    socklen_t length = sizeof address_;
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&address_), &length), 0);
  }
  ~FirstHeartbeatTest() override { close(socket_); }
  // The datagram that came, or nothing.
  std::vector<std::uint8_t> heard() {
    std::vector<std::uint8_t> datagram(1000);
    const auto size = recv(socket_, datagram.data(), datagram.size(), MSG_DONTWAIT);
    datagram.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
    return datagram;
  }
  int socket_ = -1;
  sockaddr_in address_{};
  FirstHeartbeat heartbeat_;
};

TEST_F(FirstHeartbeatTest, TheFirstQuestionOfAReaderIsAnswered) {
  heartbeat_.expect(writer, reader, 0x1'0000'0005, address_);
  heartbeat_.received(question(1));
  const std::vector<std::uint8_t> wanted = {
      'R',  'T', 'P', 'S', 2, 2,    1, 0x0f, 1, 0x0f, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,  // header
      0x0e, 1,   12,  0,   1, 0x10, 9, 9,    9, 9,    9, 9, 9, 9, 9, 9,              // to that participant
      0x07, 3,   28,  0,   0, 0,    4, 3,    0, 0,    1, 3, 1, 0, 0, 0, 6, 0, 0, 0, 1, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_THAT(heard(), ElementsAreArray(wanted));
}

TEST_F(FirstHeartbeatTest, OthersAreNotAnswered) {
  heartbeat_.received(question(1));
  heartbeat_.expect(gid(0x0f, 7, 2), reader, 0, address_);
  heartbeat_.expect(writer, gid(0x10, 8, 4), 0, address_);
  heartbeat_.received(question(1));
  EXPECT_TRUE(heard().empty());
}

TEST_F(FirstHeartbeatTest, AReaderThatKnowsMoreIsLeftToTheVendor) {
  heartbeat_.expect(writer, reader, 5, address_);
  heartbeat_.received(question(7));
  heartbeat_.received(question(1));
  EXPECT_TRUE(heard().empty());
  heartbeat_.expect(writer, reader, 5, address_);
  heartbeat_.received(question(1, 1));
  heartbeat_.received(question(1));
  EXPECT_TRUE(heard().empty());
}

TEST_F(FirstHeartbeatTest, ItIsRepeatedAFewTimesButNotForEver) {
  heartbeat_.expect(writer, reader, 5, address_);
  for (int i = 0; i < 3; ++i) {
    heartbeat_.received(question(1));
    EXPECT_FALSE(heard().empty());
  }
  heartbeat_.received(question(1));
  EXPECT_TRUE(heard().empty());
}

TEST_F(FirstHeartbeatTest, ItPrecedesTheVendorsHeartbeatsUntilTheReaderHasHeardOne) {
  heartbeat_.expect(writer, reader, 5, address_);
  heartbeat_.sending(empty_heartbeat(gid(0x0f, 7, 2), reader, 5));
  EXPECT_TRUE(heard().empty());
  for (int i = 0; i < 5; ++i) {
    heartbeat_.sending(empty_heartbeat(writer, reader, 8));
    EXPECT_THAT(heard(), ElementsAreArray(empty_heartbeat(writer, reader, 5)));
  }
  heartbeat_.received(question(9));
  heartbeat_.sending(empty_heartbeat(writer, reader, 8));
  EXPECT_TRUE(heard().empty());
}

TEST_F(FirstHeartbeatTest, WhoeverLeftIsForgotten) {
  heartbeat_.expect(writer, reader, 5, address_);
  heartbeat_.forget(writer, reader);
  heartbeat_.received(question(1));
  heartbeat_.expect(writer, reader, 5, address_);
  heartbeat_.forget(writer);
  heartbeat_.received(question(1));
  EXPECT_TRUE(heard().empty());
}

TEST_F(FirstHeartbeatTest, DatagramsCutShortAreReadToTheirEndOnly) {
  heartbeat_.expect(writer, reader, 5, address_);
  const std::vector<std::uint8_t> whole = question(1);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::uint8_t> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    heartbeat_.received(cut);
  }
  EXPECT_TRUE(heard().empty());
}

TEST(AckNacks, OfBothByteOrdersAreRead) {
  std::vector<std::uint8_t> big = {'R', 'T', 'P', 'S', 2, 1, 1, 0x10, 1, 0x10, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9};
  big.insert(big.end(), {0x06, 0, 0, 24, 0, 0, 4, 3, 0, 0, 1, 3, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1});
  const auto found = acknacks_in(big);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].base, 0x1'0000'0002u);
  EXPECT_EQ(found[0].reader, reader);
  EXPECT_FALSE(found[0].asks);
}

}  // namespace
}  // namespace adit::fastdds
