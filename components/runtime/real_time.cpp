#include "components/runtime/real_time.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace adit {
namespace {

std::string reason(int error) {
  return std::generic_category().message(error);
}

void set_priority(std::jthread& thread, int priority, const std::string& name, std::vector<std::string>& refused) {
  if (priority < 1 || priority > 99) {
    refused.push_back("executor '" + name + "': priority " + std::to_string(priority) +
                      " is not a SCHED_FIFO priority: give 1..99, or 0 for normal scheduling");
    return;
  }
  const sched_param parameters{priority};
  if (const int error = pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters)) {
    refused.push_back("executor '" + name + "': SCHED_FIFO priority " + std::to_string(priority) + " refused (" +
                      reason(error) + "): running with normal scheduling. Allow it with LimitRTPRIO=" +
                      std::to_string(priority) + " (systemd), 'rtprio' in /etc/security/limits.conf, or CAP_SYS_NICE");
  }
}

void set_affinity(std::jthread& thread, const std::vector<int>& cpus, const std::string& name,
                  std::vector<std::string>& refused) {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::string listed;
  for (const int cpu : cpus) {
    if (cpu >= 0 && cpu < CPU_SETSIZE) CPU_SET(cpu, &set);
    listed += (listed.empty() ? "" : ", ") + std::to_string(cpu);
  }
  if (const int error = pthread_setaffinity_np(thread.native_handle(), sizeof set, &set)) {
    refused.push_back("executor '" + name + "': CPUs [" + listed + "] refused (" + reason(error) +
                      "): running on any CPU. This machine has CPUs 0.." +
                      std::to_string(sysconf(_SC_NPROCESSORS_CONF) - 1) + "; see also the cpuset of the service");
  }
}

}  // namespace

void name_thread(std::jthread& thread, const std::string& name) {
  pthread_setname_np(thread.native_handle(), name.substr(0, 15).c_str());  // 15 is the kernel's limit
}

void set_scheduling(std::span<std::jthread> threads, int priority, const std::vector<int>& cpus,
                    const std::string& name, std::vector<std::string>& refused) {
  // What one thread is refused, all are: say it once.
  const std::size_t before = refused.size();
  for (std::jthread& thread : threads) {
    if (refused.size() > before) break;
    if (priority != 0) set_priority(thread, priority, name, refused);
    if (!cpus.empty()) set_affinity(thread, cpus, name, refused);
  }
}

void lock_memory(std::vector<std::string>& refused) {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  // With a finite limit MCL_FUTURE would make later allocations fail, in the middle of a mission.
  int error = EPERM;
  if (limit.rlim_cur == RLIM_INFINITY || geteuid() == 0) {
    error = mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
  }
  if (error) {
    refused.push_back("locking memory refused (" + reason(error) +
                      "): page faults may delay handlers. Allow it with LimitMEMLOCK=infinity (systemd), 'memlock "
                      "unlimited' in /etc/security/limits.conf, or CAP_IPC_LOCK");
  }
}

}  // namespace adit
