#include "middleware/cyclonedds/configuration.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <sstream>

namespace adit::cyclonedds {
namespace {

struct Interface {
  std::string name;
  std::string address;
  bool loopback = false;
};

std::vector<Interface> ipv4_interfaces() {
  std::vector<Interface> found;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, &freeifaddrs);
  for (const ifaddrs* entry = list; entry; entry = entry->ifa_next) {
    if (!entry->ifa_addr || entry->ifa_addr->sa_family != AF_INET || !(entry->ifa_flags & IFF_UP)) continue;
    char text[INET_ADDRSTRLEN] = "";
    const auto* const address = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
    inet_ntop(AF_INET, &address->sin_addr, text, sizeof text);
    found.push_back({entry->ifa_name, text, (entry->ifa_flags & IFF_LOOPBACK) != 0});
  }
  return found;
}

Result<Interface> find_interface(const std::string& network) {
  if (network == "loopback") return Interface{"lo", "127.0.0.1", true};
  std::string known;
  for (const Interface& interface : ipv4_interfaces()) {
    if (interface.name == network || interface.address == network) return interface;
    known += (known.empty() ? "" : ", ") + interface.name + " (" + interface.address + ")";
  }
  return Error{ErrorCode::not_found, "network '" + network +
                                         "' is no interface of this host that is up with an IPv4 address: use "
                                         "loopback, or one of " +
                                         known};
}

// What the kernel grants of `wanted`, which is what rmem_max or wmem_max allow.
std::size_t granted_buffer(int option, std::size_t wanted) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return 0;
  int bytes = static_cast<int>(std::min<std::size_t>(wanted, 1u << 30));
  setsockopt(socket, SOL_SOCKET, option, &bytes, sizeof bytes);
  socklen_t length = sizeof bytes;
  if (getsockopt(socket, SOL_SOCKET, option, &bytes, &length) != 0) bytes = 0;
  close(socket);
  return static_cast<std::size_t>(bytes) / 2;  // Linux reports twice what it was asked for, see socket(7)
}

std::string small_buffer_warning(const char* which, const char* key, std::size_t wanted, std::size_t granted) {
  return std::string("the kernel grants a ") + which + " buffer of " + std::to_string(granted) + " of the " +
         std::to_string(wanted) + " bytes asked for, large messages will be lost: sysctl -w net.core." + key + "=" +
         std::to_string(wanted);
}

bool is_peer_address(const std::string& peer) {
  return !peer.empty() && peer.find_first_of("<>&\"' ") == std::string::npos;
}

// Ports are 7400 + 250 domain + 10 + 2 index (RTPS 2.2, 9.6.1.1): beyond index 119 lies the next domain.
std::uint32_t last_index(std::uint32_t domain) {
  return std::min<std::uint32_t>(119, (65535 - 7400 - 250 * domain - 11) / 2);
}

}  // namespace

Result<Configuration> make_configuration(const ParticipantConfig& config) {
  if (config.domain > 232) {
    return Error{ErrorCode::invalid_argument,
                 "domain " + std::to_string(config.domain) + " is out of range: use 0 to 232"};
  }
  const auto interface = find_interface(config.network);
  if (!interface) return interface.error();

  std::vector<std::string> peers = {interface->address};  // the other processes of this host
  for (const std::string& peer : config.peers) {
    if (!is_peer_address(peer)) {
      return Error{ErrorCode::invalid_argument, "peer '" + peer + "' is no address: use ADDRESS or ADDRESS:PORT"};
    }
    if (interface->loopback && !peer.starts_with("127.") && peer != "localhost") {
      return Error{ErrorCode::invalid_argument,
                   "peer " + peer + " cannot be reached over loopback: name the interface that leads to it in network"};
    }
    if (std::find(peers.begin(), peers.end(), peer) == peers.end()) peers.push_back(peer);
  }

  Configuration result;
  result.peers = std::move(peers);
  result.multicast = config.multicast && !interface->loopback;
  result.interface = interface->name + " (" + interface->address + ")";
  result.receive_buffer = granted_buffer(SO_RCVBUF, config.socket_buffer_bytes);
  result.send_buffer = granted_buffer(SO_SNDBUF, config.socket_buffer_bytes);
  if (result.receive_buffer < config.socket_buffer_bytes) {
    result.warnings.push_back(
        small_buffer_warning("receive", "rmem_max", config.socket_buffer_bytes, result.receive_buffer));
  }
  if (result.send_buffer < config.socket_buffer_bytes) {
    result.warnings.push_back(small_buffer_warning("send", "wmem_max", config.socket_buffer_bytes, result.send_buffer));
  }
  result.last_participant_index = last_index(config.domain);

  // One datagram a fragment: nearly what UDP allows on loopback (our Fast DDS side receives up to 65000 bytes), within
  // an Ethernet frame elsewhere.
  const std::size_t message_bytes = interface->loopback ? 65000 : 1472;
  result.fragment_bytes = interface->loopback ? 64000 : 1344;

  std::ostringstream xml;
  xml << "<Domain><General><Interfaces><NetworkInterface address=\"" << interface->address << "\"/></Interfaces>"
      << "<AllowMulticast>" << (result.multicast ? "spdp" : "false") << "</AllowMulticast>"
      << "<MaxMessageSize>" << message_bytes << "B</MaxMessageSize>"
      << "<FragmentSize>" << result.fragment_bytes << "B</FragmentSize></General>"
      << "<Discovery><ExternalDomainId>" << config.domain << "</ExternalDomainId>"
      << "<ParticipantIndex>auto</ParticipantIndex>"
      << "<MaxAutoParticipantIndex>" << result.last_participant_index << "</MaxAutoParticipantIndex><Peers>";
  for (const std::string& peer : result.peers) xml << "<Peer address=\"" << peer << "\"/>";
  // GenerateKeyhash: Fast DDS sees that one of our endpoints is gone by the key hash only.
  xml << "</Peers></Discovery><Internal>"
      << "<SocketReceiveBufferSize min=\"" << result.receive_buffer << "B\" max=\"" << result.receive_buffer << "B\"/>"
      << "<SocketSendBufferSize min=\"" << result.send_buffer << "B\" max=\"" << result.send_buffer << "B\"/>"
      << "<GenerateKeyhash>true</GenerateKeyhash>"
      // Repair of a lost 4 MB sample in one round: the defaults stop after 512 kB and ask again 100 ms later.
      << "<BurstSize><MaxRexmit>16MB</MaxRexmit></BurstSize>"
      << "<MaxQueuedRexmitBytes>16MB</MaxQueuedRexmitBytes><MaxQueuedRexmitMessages>2000</MaxQueuedRexmitMessages>"
      << "<NackDelay>" << (interface->loopback ? 10 : 20)
      << "ms</NackDelay>"
      // A reader that misses something asks again after this, not only when the writer's next heartbeat comes (3 s).
      << "<AutoReschedNackDelay>" << (interface->loopback ? 20 : 200)
      << "ms</AutoReschedNackDelay>"
      // How long a new reader waits before it asks a writer what there is: 10 ms by default, twice in each discovery.
      << "<PreEmptiveAckDelay>1ms</PreEmptiveAckDelay></Internal></Domain>";
  result.xml = xml.str();
  return result;
}

}  // namespace adit::cyclonedds
