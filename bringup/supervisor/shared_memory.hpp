// Fast DDS' shared-memory segments in /dev/shm: who has them mapped. A killed process leaves its segment behind.
#pragma once

#include <sys/types.h>

#include <set>
#include <string>

namespace adit {

// Names (without the folder) of Fast DDS segments that a process has mapped, from <proc>/<pid>/maps.
std::set<std::string> segments_of(const std::string& proc, const std::string& shm, pid_t pid);

// The same for all processes that this user may look at.
std::set<std::string> mapped_segments(const std::string& proc, const std::string& shm);

// Removes from `shm` those of `segments` that nobody has mapped any more, with their lock files. How many.
std::size_t remove_unmapped(const std::set<std::string>& segments, const std::string& proc, const std::string& shm);

}  // namespace adit
