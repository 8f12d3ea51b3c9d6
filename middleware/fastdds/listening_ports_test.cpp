#include "middleware/fastdds/listening_ports.hpp"

#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace adit::fastdds {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Not;

TEST(ListeningPorts, OfLoopbackAndOfAllInterfacesAreFoundInTheKernelsTable) {
  std::vector<std::uint16_t> ports;
  add_loopback_ports(
      "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
      "  101: 0100007F:1CE8 00000000:0000 07 00000000:00000000 00:00000000 00000000  0  0 1 2 0 0\n"
      " 2102: 00000000:1CE9 00000000:0000 07 00000000:00000000 00:00000000 00000000  0  0 1 2 0 0\n"
      "   12: 0A00000A:0035 00000000:0000 07 00000000:00000000 00:00000000 00000000  0  0 1 2 0 0\n",
      ports);
  add_loopback_ports(
      "  sl  local_address                         remote_address                        st\n"
      "  7: 00000000000000000000000000000000:0222 00000000000000000000000000000000:0000 07\n"
      "  8: 000080FE00000000FF00A8C0FEFF0001:0223 00000000000000000000000000000000:0000 07\n",
      ports);
  EXPECT_THAT(ports, ElementsAre(0x1CE8, 0x1CE9, 0x222));
}

TEST(ListeningPorts, LinesCutShortAreLeftOut) {
  std::vector<std::uint16_t> ports;
  for (const char* table : {"", "\n", "1: ", "1: 0100007F", "1: 0100007F:", "1: 0100007F:1C", "1: :1CE8", "1: 7F:1CE8",
                            "1: 0100007F:1CGE 0", "1: \n2: 0100007F:ZZZZ"}) {
    add_loopback_ports(table, ports);
  }
  EXPECT_TRUE(ports.empty());
}

TEST(ListeningPorts, ASocketOfThisProcessIsListedWhileItIsOpen) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ASSERT_GE(socket, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  socklen_t length = sizeof address;
  ASSERT_EQ(getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length), 0);
  const std::uint16_t port = ntohs(address.sin_port);
  EXPECT_THAT(listening_loopback_ports(), Contains(port));
  close(socket);
  EXPECT_THAT(listening_loopback_ports(), Not(Contains(port)));
}

}  // namespace
}  // namespace adit::fastdds
