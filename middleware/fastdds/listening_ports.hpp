// Which UDP ports of this host somebody listens at.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace adit::fastdds {

// The ports of one table of the kernel, /proc/net/udp or udp6 (proc(5)), that datagrams to 127.0.0.1 can reach.
void add_loopback_ports(std::string_view table, std::vector<std::uint16_t>& ports);

// Both tables, sorted. Empty when they cannot be read: then nothing is known.
std::vector<std::uint16_t> listening_loopback_ports();

}  // namespace adit::fastdds
