#include "bringup/doctor/doctor.hpp"

#include <arpa/inet.h>
#include <dirent.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <sys/un.h>
#include <unistd.h>

#include <cctype>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "bringup/commands/graph_table.hpp"
#include "bringup/supervisor/shared_memory.hpp"
#include "middleware/participant.hpp"

namespace adit::doctor {
namespace {

using Level = Finding::Level;

std::string megabytes(std::size_t bytes) {
  return std::to_string(bytes >> 20) + " MB";
}

}  // namespace

Finding check_socket_buffers(const Machine& machine, std::size_t wanted_bytes) {
  std::string small;
  for (const char* name : {"rmem_max", "wmem_max"}) {
    std::ifstream file(machine.proc + "/sys/net/core/" + name);
    std::size_t bytes = 0;
    if (!(file >> bytes)) {
      return {Level::warning, "kernel socket buffers", std::string("cannot read net.core.") + name,
              "run on Linux with /proc mounted"};
    }
    if (bytes < wanted_bytes)
      small += std::string(small.empty() ? "" : " ") + "net.core." + name + "=" + std::to_string(bytes);
  }
  if (small.empty()) return {Level::ok, "kernel socket buffers", "at least " + megabytes(wanted_bytes), ""};
  return {Level::warning, "kernel socket buffers", small + ": large clouds over UDP may be lost",
          "sudo sysctl -w net.core.rmem_max=" + std::to_string(wanted_bytes) + " net.core.wmem_max=" +
              std::to_string(wanted_bytes) + "   (permanently: the same two lines in /etc/sysctl.d/60-adit.conf)"};
}

Finding check_shared_memory(const Machine& machine, std::size_t wanted_bytes) {
  struct statvfs status {};
  if (::statvfs(machine.shm.c_str(), &status) != 0) {
    return {Level::failure, "shared memory", machine.shm + ": " + std::strerror(errno),
            "sudo mount -t tmpfs tmpfs " + machine.shm};
  }
  const std::size_t free_bytes = static_cast<std::size_t>(status.f_bavail) * status.f_frsize;
  if (::access(machine.shm.c_str(), W_OK) != 0) {
    return {Level::failure, "shared memory", machine.shm + " is not writable",
            "sudo chmod 1777 " + machine.shm + ", or set `shared_memory: false`"};
  }
  if (free_bytes < 2 * wanted_bytes) {
    return {Level::warning, "shared memory", megabytes(free_bytes) + " free in " + machine.shm,
            "sudo mount -o remount,size=512M " + machine.shm + ", or a smaller `shared_memory_bytes`"};
  }
  return {Level::ok, "shared memory", megabytes(free_bytes) + " free in " + machine.shm, ""};
}

Finding check_stale_segments(const Machine& machine) {
  std::error_code bad;
  std::vector<std::string> segments;
  for (const auto& entry : std::filesystem::directory_iterator(machine.shm, bad)) {
    const std::string name = entry.path().filename();
    // Semaphores and ports are shared by all; a participant's segment is one that its process has mapped.
    if (name.starts_with("fastrtps_") && !name.starts_with("fastrtps_port") && !name.ends_with("_el")) {
      segments.push_back(name);
    }
  }
  if (segments.empty()) return {Level::ok, "stale shared memory", "none", ""};
  const std::set<std::string> mapped = mapped_segments(machine.proc, machine.shm);
  std::string stale;
  for (const std::string& name : segments) {
    if (!mapped.contains(name)) stale += " " + machine.shm + "/" + name;
  }
  if (stale.empty())
    return {Level::ok, "stale shared memory", std::to_string(segments.size()) + " segments, all in use", ""};
  return {Level::warning, "stale shared memory", "segments that no process of yours has mapped:" + stale,
          "when no other user runs Fast DDS here: rm" + stale};
}

Finding check_interface(const std::string& network) {
  const std::string wanted = network == "loopback" ? "lo" : network;
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) {
    return {Level::warning, "network interface", std::string("cannot list interfaces: ") + std::strerror(errno),
            "run as a user that may"};
  }
  std::string names;
  Finding finding{Level::failure, "network interface", "", ""};
  for (const ifaddrs* i = list; i; i = i->ifa_next) {
    if (!i->ifa_addr || i->ifa_addr->sa_family != AF_INET) continue;
    char address[INET_ADDRSTRLEN] = "";
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(i->ifa_addr)->sin_addr, address, sizeof address);
    names += std::string(names.empty() ? "" : ", ") + i->ifa_name + " (" + address + ")";
    if (wanted != i->ifa_name && wanted != address) continue;
    finding.finding = std::string(i->ifa_name) + " " + address;
    if (i->ifa_flags & IFF_UP) {
      finding.level = Level::ok;
    } else {
      finding.finding += " is down";
      finding.fix = std::string("sudo ip link set ") + i->ifa_name + " up";
    }
  }
  ::freeifaddrs(list);
  if (finding.finding.empty()) {
    finding.finding = "no interface '" + wanted + "'";
    finding.fix = "set `network:` to one of: loopback, " + names;
  }
  return finding;
}

Finding check_clock() {
  timex state{};
  const int synchronized = ::adjtimex(&state);
  const std::int64_t now = std::chrono::duration_cast<std::chrono::seconds>(system_now().time_since_epoch()).count();
  if (now < 1'600'000'000) {
    return {Level::failure, "clock", "the system time is before 2020",
            "set it (a board without a battery needs NTP, PTP or a GNSS)"};
  }
  if (synchronized == TIME_ERROR) {
    return {Level::warning, "clock", "not synchronized: stamps of several hosts cannot be compared",
            "run chrony or ptp4l where more than one host takes part"};
  }
  return {Level::ok, "clock", "synchronized", ""};
}

Finding check_realtime_permission() {
  rlimit limit{};
  ::getrlimit(RLIMIT_RTPRIO, &limit);
  if (::geteuid() == 0 || limit.rlim_cur > 0) return {Level::ok, "real-time priority", "allowed", ""};
  return {Level::warning, "real-time priority", "not allowed: `priority:` of an executor will be refused",
          "LimitRTPRIO=40 in the systemd unit, or '@realtime - rtprio 40' in /etc/security/limits.d/adit.conf"};
}

Finding check_locked_memory() {
  rlimit limit{};
  ::getrlimit(RLIMIT_MEMLOCK, &limit);
  if (::geteuid() == 0 || limit.rlim_cur == RLIM_INFINITY) return {Level::ok, "locked memory", "allowed", ""};
  return {Level::warning, "locked memory",
          "limited to " + megabytes(limit.rlim_cur) + ": `lock_memory:` may be refused",
          "LimitMEMLOCK=infinity in the systemd unit, or '@realtime - memlock unlimited' in "
          "/etc/security/limits.d/adit.conf"};
}

Finding check_roudi() {
  // RouDi holds this socket for as long as it runs; a file that nobody listens on is a leftover.
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, "/tmp/roudi", sizeof address.sun_path - 1);
  const bool running = fd >= 0 && ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  if (fd >= 0) ::close(fd);
  return {Level::ok, "RouDi", running ? "running; Cyclone DDS uses UDP here all the same" : "not running, not needed",
          ""};
}

std::vector<Finding> check_vendors(const ParticipantConfig& config) {
  std::vector<Finding> findings;
  for (const std::string_view vendor : built_in_vendors()) {
    ParticipantConfig one = config;
    one.vendor = vendor;
    one.name = "adit doctor";
    const Result<std::unique_ptr<Participant>> participant = open(one);
    findings.push_back(
        participant
            ? Finding{Level::ok, "middleware " + one.vendor, "opens domain " + std::to_string(config.domain), ""}
            : Finding{Level::failure, "middleware " + one.vendor, participant.error().message,
                      "see the message; `adit explain --middleware " + one.vendor + "` shows more"});
  }
  return findings;
}

std::vector<Finding> check_domain(const ParticipantConfig& config) {
  const Result<std::unique_ptr<Participant>> participant = open(config);
  if (!participant) return {};  // check_vendors has said why
  const Graph graph = settled_graph(**participant, std::chrono::seconds(2));
  std::vector<Finding> findings;
  for (const EndpointInfo& writer : graph.endpoints) {
    for (const EndpointInfo& reader : graph.endpoints) {
      if (!writer.is_writer || reader.is_writer || writer.dds_topic != reader.dds_topic) continue;
      if (writer.dds_type != reader.dds_type) {
        findings.push_back({Level::failure, "type of " + writer.topic,
                            writer.node + " writes " + writer.type + ", " + reader.node + " reads " + reader.type,
                            "remap one of them to another topic"});
        continue;
      }
      for (const Mismatch& mismatch : check(writer.qos, reader.qos)) {
        findings.push_back({Level::failure, "QoS of " + writer.topic,
                            writer.node + " offers " + mismatch.policy + " " + mismatch.offered + ", " + reader.node +
                                " requests " + mismatch.requested,
                            mismatch.remedy});
      }
    }
  }
  if (findings.empty()) {
    findings.push_back({Level::ok, "domain " + std::to_string(config.domain),
                        std::to_string(graph.participants.size() - 1) + " other participants, " +
                            std::to_string(graph.endpoints.size()) + " endpoints, QoS matches everywhere",
                        ""});
  }
  return findings;
}

std::vector<Finding> examine(const Machine& machine, const ParticipantConfig& config) {
  std::vector<Finding> findings = {check_socket_buffers(machine, config.socket_buffer_bytes),
                                   check_shared_memory(machine, config.shared_memory_bytes),
                                   check_stale_segments(machine),
                                   check_interface(config.network),
                                   check_clock(),
                                   check_realtime_permission(),
                                   check_locked_memory(),
                                   check_roudi()};
  for (auto* more : {&check_vendors, &check_domain}) {
    for (Finding& finding : more(config)) findings.push_back(std::move(finding));
  }
  return findings;
}

std::string to_text(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) {
    const char* const mark = finding.level == Level::ok        ? "ok    "
                             : finding.level == Level::warning ? "WARN  "
                                                               : "FAIL  ";
    text += mark + finding.check + ": " + finding.finding + "\n";
    if (!finding.fix.empty()) text += "      fix: " + finding.fix + "\n";
  }
  return text;
}

}  // namespace adit::doctor
