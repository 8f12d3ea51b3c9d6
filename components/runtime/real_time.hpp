// Scheduling, CPU affinity and locked memory; every refusal by the system is one line that says what to do.
#pragma once

#include <span>
#include <string>
#include <thread>
#include <vector>

namespace adit {

void name_thread(std::jthread& thread, const std::string& name);
void set_scheduling(std::span<std::jthread> threads, int priority, const std::vector<int>& cpus,
                    const std::string& name, std::vector<std::string>& refused);
void lock_memory(std::vector<std::string>& refused);

}  // namespace adit
