#include "middleware/fastdds/configuration.hpp"

#include <arpa/inet.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fcntl.h>
#include <ifaddrs.h>
#include <netdb.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "middleware/fastdds/values.hpp"

namespace adit::fastdds {
namespace {

using eprosima::fastdds::rtps::SharedMemTransportDescriptor;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::rtps::IPLocator;

// Participants of a host are looked for at the ports of this many participant ids (the vendor's default: 4).
constexpr std::uint32_t participants_per_host = 120;
// The vendor drops datagrams larger than what it may send itself, so UDP always allows the largest (Cyclone DDS sends
// up to 65500); what we send is limited by the other transport's maximum, for the vendor fragments by the smallest of
// all.
constexpr std::uint32_t largest_message_bytes = 65500;
constexpr std::uint32_t ethernet_message_bytes = 1472;  // fits an MTU of 1500 without IP fragmentation
constexpr std::uint32_t smallest_segment = 1 << 20;
constexpr std::uint32_t port_queue_capacity = 4096;

bool is_loopback(std::string_view address) {
  return address.starts_with("127.") || address == "localhost";
}

// IPv4 address of an interface given by name or address.
Result<std::string> interface_address(const std::string& wanted) {
  if (wanted == "loopback" || wanted == "lo" || is_loopback(wanted)) return std::string("127.0.0.1");
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return Error{ErrorCode::unavailable, "cannot list the network interfaces"};
  std::string found, present;
  for (const ifaddrs* it = list; it; it = it->ifa_next) {
    if (!it->ifa_addr || it->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN] = {};
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(it->ifa_addr)->sin_addr, text, sizeof text);
    present += std::string(present.empty() ? "" : ", ") + it->ifa_name + " (" + text + ")";
    if (wanted == it->ifa_name || wanted == text) found = text;
  }
  freeifaddrs(list);
  if (!found.empty()) return found;
  return Error{ErrorCode::not_found, "network interface '" + wanted +
                                         "' does not exist or has no IPv4 address: use one of " + present +
                                         ", or 'loopback'"};
}

Result<std::string> resolve(const std::string& peer) {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  addrinfo* answers = nullptr;
  if (getaddrinfo(peer.c_str(), nullptr, &hints, &answers) != 0 || !answers) {
    return Error{ErrorCode::not_found, "peer '" + peer + "' is neither an IPv4 address nor a host name that resolves"};
  }
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(answers->ai_addr)->sin_addr, text, sizeof text);
  freeaddrinfo(answers);
  return std::string(text);
}

rtps::Locator_t locator(const std::string& address, std::uint32_t port) {
  rtps::Locator_t result;
  result.kind = LOCATOR_KIND_UDPv4;
  result.port = port;
  IPLocator::setIPv4(result, address);
  return result;
}

// The ports where a host's participants listen for discovery.
void look_for_participants(const std::string& address, std::uint32_t domain, const rtps::PortParameters& ports,
                           rtps::LocatorList_t& peers) {
  const std::uint32_t first = ports.portBase + ports.domainIDGain * domain + ports.offsetd1;
  const std::uint32_t fitting = (65535 - first) / ports.participantIDGain;
  for (std::uint32_t id = 0; id < std::min(participants_per_host, fitting); ++id) {
    peers.push_back(locator(address, first + ports.participantIDGain * id));
  }
}

// What the kernel really grants to a socket that asks for `wanted` bytes.
std::size_t granted_buffer(int option, std::size_t wanted) {
  const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return 0;
  const int bytes = static_cast<int>(std::min<std::size_t>(wanted, 1 << 30));
  int granted = 0;
  socklen_t length = sizeof granted;
  setsockopt(probe, SOL_SOCKET, option, &bytes, sizeof bytes);
  getsockopt(probe, SOL_SOCKET, option, &granted, &length);
  close(probe);
  return static_cast<std::size_t>(granted) / 2;  // the kernel reports twice the payload it grants
}

std::string buffer_line(const char* name, const char* sysctl, std::size_t wanted, std::size_t granted) {
  std::string line =
      std::string(name) + ": " + std::to_string(granted) + " bytes granted of " + std::to_string(wanted) + " asked\n";
  if (granted < wanted) {
    line += std::string("warning: large messages may be lost; run: sysctl -w ") + sysctl + "=" +
            std::to_string(wanted) + "\n";
  }
  return line;
}

// Why shared memory cannot be used here; empty when it can.
std::string shared_memory_obstacle(std::size_t bytes) {
  const std::string probe = "/adit_probe_" + std::to_string(getpid());
  const int file = shm_open(probe.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0 && errno != EEXIST) return std::string("cannot create files in /dev/shm: ") + std::strerror(errno);
  if (file >= 0) {
    close(file);
    shm_unlink(probe.c_str());
  }
  struct statvfs space {};
  if (statvfs("/dev/shm", &space) == 0 && space.f_bavail * space.f_frsize < bytes + (4u << 20)) {
    return "/dev/shm has " + std::to_string(space.f_bavail * space.f_frsize >> 20) + " MB free, " +
           std::to_string(bytes >> 20) + " MB are needed; remount it larger or remove files of ended programs";
  }
  return {};
}

// Left-overs of other users cannot be opened, and make the vendor fail with "open_and_lock_file failed".
std::string foreign_shared_memory() {
  std::size_t foreign = 0;
  std::string example;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/shm", ignored)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with("fastrtps_") && !name.starts_with("sem.fastrtps_")) continue;
    if (access(entry.path().c_str(), R_OK | W_OK) == 0) continue;
    ++foreign;
    example = name;
  }
  if (foreign == 0) return {};
  return "warning: " + std::to_string(foreign) + " shared-memory files of another user in /dev/shm (" + example +
         ", ...); if their owner is gone, let the owner or root remove them\n";
}

Result<void> set_security(const SecurityConfig& security, dds::DomainParticipantQos& qos) {
  namespace fs = std::filesystem;
  std::string enclave = security.enclave;
  enclave.erase(0, enclave.find_first_not_of('/'));
  const fs::path folder = fs::path(security.keystore) / "enclaves" / enclave;
  const auto set = [&](const char* property, const std::string& value) {
    qos.properties().properties().emplace_back(property, value);
  };
  const auto set_file = [&](const char* property, const char* name) -> Result<void> {
    const fs::path path = folder / name;
    if (access(path.c_str(), R_OK) != 0) {
      return Error{ErrorCode::unavailable, "DDS Security: cannot read " + path.string() + ": " + std::strerror(errno) +
                                               "; create the enclave in the keystore, or correct keystore and enclave"};
    }
    set(property, "file://" + path.string());
    return {};
  };
  const std::pair<const char*, const char*> files[] = {
      {"dds.sec.auth.builtin.PKI-DH.identity_ca", "identity_ca.cert.pem"},
      {"dds.sec.auth.builtin.PKI-DH.identity_certificate", "cert.pem"},
      {"dds.sec.auth.builtin.PKI-DH.private_key", "key.pem"},
      {"dds.sec.access.builtin.Access-Permissions.permissions_ca", "permissions_ca.cert.pem"},
      {"dds.sec.access.builtin.Access-Permissions.governance", "governance.p7s"},
      {"dds.sec.access.builtin.Access-Permissions.permissions", "permissions.p7s"}};
  for (const auto& [property, name] : files) {
    if (auto result = set_file(property, name); !result) return result;
  }
  set("dds.sec.auth.plugin", "builtin.PKI-DH");
  set("dds.sec.access.plugin", "builtin.Access-Permissions");
  set("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
  return {};
}

}  // namespace

Result<Configuration> configure(const ParticipantConfig& config, std::string_view user_data) {
  const auto address = interface_address(config.network);
  if (!address) return address.error();

  Configuration result;
  result.loopback = is_loopback(*address);
  std::string& text = result.explanation;
  text +=
      "interface: " + *address + (result.loopback ? " (nothing leaves this host)\n" : " (" + config.network + ")\n");

  auto& qos = result.qos;
  qos.name(config.name);
  qos.user_data().setValue(to_octets(user_data));
  qos.entity_factory().autoenable_created_entities = true;

  // Transports.
  const auto message_bytes = result.loopback || !config.shared_memory ? largest_message_bytes : ethernet_message_bytes;
  const auto buffer =
      static_cast<std::uint32_t>(std::clamp<std::size_t>(config.socket_buffer_bytes, largest_message_bytes, 1u << 30));
  auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {*address};
  udp->maxMessageSize = largest_message_bytes;
  udp->sendBufferSize = udp->receiveBufferSize = buffer;
  auto& transport = qos.transport();
  transport.use_builtin_transports = false;
  transport.send_socket_buffer_size = transport.listen_socket_buffer_size = buffer;
  text += "UDP message: at most " + std::to_string(message_bytes) + " bytes\n";
  if (!result.loopback && message_bytes > ethernet_message_bytes) {
    text += "note: without shared memory messages are cut into datagrams by the kernel (IP fragmentation)\n";
  }
  text += buffer_line("UDP receive buffer", "net.core.rmem_max", buffer, granted_buffer(SO_RCVBUF, buffer));
  text += buffer_line("UDP send buffer", "net.core.wmem_max", buffer, granted_buffer(SO_SNDBUF, buffer));
  if (config.shared_memory) {
    const auto segment =
        static_cast<std::uint32_t>(std::clamp<std::size_t>(config.shared_memory_bytes, smallest_segment, 1u << 30));
    if (const auto obstacle = shared_memory_obstacle(segment); obstacle.empty()) {
      auto memory = std::make_shared<SharedMemTransportDescriptor>();
      memory->segment_size(segment);
      memory->max_message_size(message_bytes);
      memory->port_queue_capacity(port_queue_capacity);
      transport.user_transports.push_back(memory);
      text += "shared memory: segment of " + std::to_string(segment) + " bytes, " +
              std::to_string(port_queue_capacity) + " messages queued a port\n" + foreign_shared_memory();
    } else {
      text += "warning: shared memory is not used: " + obstacle + "\n";
    }
  } else {
    text += "shared memory: switched off\n";
  }
  if (!config.security) result.first_heartbeat = std::make_shared<FirstHeartbeat>();
  result.audible = std::make_shared<std::atomic<bool>>(false);
  transport.user_transports.push_back(std::make_shared<LateAnnouncement>(udp, result.audible, result.first_heartbeat));

  // Discovery: unicast to the host itself and the static peers; the ports of all participant ids are tried.
  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.leaseDuration = {10, 0};
  builtin.discovery_config.leaseDuration_announcementperiod = {1, 0};
  // On loopback they cost little (see LateAnnouncement); the first that is heard comes within this period.
  if (result.loopback) {
    builtin.discovery_config.initial_announcements = {5, {0, 2'000'000}};
  } else {
    builtin.discovery_config.initial_announcements = {5, {0, 10'000'000}};
  }
  const auto& ports = qos.wire_protocol().port;
  look_for_participants(*address, config.domain, ports, builtin.initialPeersList);
  text += "discovery: unicast to " + *address;
  for (const auto& peer : config.peers) {
    const auto resolved = resolve(peer);
    if (!resolved) return resolved.error();
    if (result.loopback && !is_loopback(*resolved)) {
      return Error{ErrorCode::invalid_argument, "peer " + peer +
                                                    " cannot be reached over loopback: name the interface "
                                                    "that leads to it (network: eth0)"};
    }
    if (*resolved == *address) continue;
    look_for_participants(*resolved, config.domain, ports, builtin.initialPeersList);
    text += ", " + *resolved;
  }
  text += ", participant ids 0 to " + std::to_string(participants_per_host - 1);
  if (config.multicast && !result.loopback) {
    const auto group = locator("239.255.0.1", ports.getMulticastPort(config.domain));
    builtin.initialPeersList.push_back(group);
    builtin.metatrafficMulticastLocatorList.push_back(group);
    text += ", multicast 239.255.0.1";
  }
  builtin.metatrafficUnicastLocatorList.push_back(locator(*address, 0));  // the port of our participant id
  text += "\n";

  if (config.security) {
    if (auto secured = set_security(*config.security, qos); !secured) return secured.error();
    text += "security: keystore " + config.security->keystore + ", enclave " + config.security->enclave + "\n";
  }
  for (const char* name : {"FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"}) {
    if (std::getenv(name)) text += std::string("note: profiles of $") + name + " do not apply to this program\n";
  }
  return result;
}

}  // namespace adit::fastdds
