#include "middleware/fastdds/listening_ports.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <string>

namespace adit::fastdds {
namespace {

// Addresses as the kernel prints them: words of 32 bits in this machine's byte order.
bool reached_from_loopback(std::string_view address) {
  const std::string_view last = address.substr(address.size() - 8);
  const bool everywhere = address.find_first_not_of('0') == std::string_view::npos;
  constexpr bool little_endian = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__;
  return everywhere || (little_endian ? last.substr(6) : last.substr(0, 2)) == "7F";
}

}  // namespace

// "   12: 0100007F:1CE9 00000000:0000 07 ...", after a line of titles.
void add_loopback_ports(std::string_view table, std::vector<std::uint16_t>& ports) {
  while (!table.empty()) {
    const std::string_view line = table.substr(0, table.find('\n'));
    table.remove_prefix(std::min(line.size() + 1, table.size()));
    const std::size_t begin = line.find(": ");
    if (begin == std::string_view::npos) continue;
    const std::size_t colon = line.find(':', begin + 2);
    if (colon == std::string_view::npos || colon - begin < 10 || line.size() < colon + 5) continue;
    std::uint16_t port = 0;
    const auto [end, error] = std::from_chars(line.data() + colon + 1, line.data() + colon + 5, port, 16);
    if (error != std::errc() || end != line.data() + colon + 5) continue;
    if (reached_from_loopback(line.substr(begin + 2, colon - begin - 2))) ports.push_back(port);
  }
}

std::vector<std::uint16_t> listening_loopback_ports() {
  std::vector<std::uint16_t> ports;
  for (const char* path : {"/proc/net/udp", "/proc/net/udp6"}) {
    std::ifstream file(path);
    const std::string table{std::istreambuf_iterator<char>(file), {}};
    add_loopback_ports(table, ports);
  }
  std::sort(ports.begin(), ports.end());
  return ports;
}

}  // namespace adit::fastdds
