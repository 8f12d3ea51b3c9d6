#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <thread>

#include "tests/benchmarks/board.hpp"
#include "tests/benchmarks/wait.hpp"

namespace adit::bench {
namespace {

constexpr unsigned window = 4;  // messages on the way while throughput is measured

}  // namespace

Pair::Pair(const std::string& implementation, const std::string& vendor, std::uint32_t domain, std::size_t bytes)
    : peer_{"", implementation, vendor, domain, bytes} {
  memory_ = memfd_create("adit_bench", 0);
  if (memory_ < 0 || ftruncate(memory_, sizeof(Board)) != 0) return;
  void* const mapped = mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED, memory_, 0);
  if (mapped == MAP_FAILED) return;
  board_ = static_cast<Board*>(mapped);
  for (sem_t* semaphore : {&board_->sender.ordered, &board_->sender.done, &board_->receiver.ordered,
                           &board_->receiver.done, &board_->credits}) {
    sem_init(semaphore, 1, 0);
  }
}

Pair::~Pair() {
  for (const bool sender : {true, false}) {
    if (processes_[sender] <= 0) continue;
    if (!ask(sender, Order::quit).empty()) kill(processes_[sender], SIGKILL);
    waitpid(processes_[sender], nullptr, 0);
  }
  if (board_) munmap(board_, sizeof(Board));
  if (memory_ >= 0) close(memory_);
}

void Pair::spawn(const std::string& role) {
  const std::vector<std::string> words = {"adit_bench",
                                          "--peer",
                                          role,
                                          peer_.implementation,
                                          peer_.vendor,
                                          std::to_string(peer_.domain),
                                          std::to_string(peer_.bytes),
                                          std::to_string(memory_)};
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    execv("/proc/self/exe", arguments.data());
    _exit(127);
  }
  processes_[role == "sender"] = child;
}

std::string Pair::ask(bool sender, Order order) {
  Desk& desk = sender ? board_->sender : board_->receiver;
  const std::string who = peer_.implementation + " " + (sender ? "sender" : "receiver") + " on " + peer_.vendor;
  desk.order = order;
  desk.ok = false;
  sem_post(&desk.ordered);
  for (int i = 0; i < 300; ++i) {
    if (wait_for(desk.done, std::chrono::milliseconds(100))) {
      return desk.ok ? "" : who + " cannot do what it should";
    }
    if (waitpid(processes_[sender], nullptr, WNOHANG) != 0) {
      processes_[sender] = -1;
      return who + " ended";
    }
  }
  return who + " does not answer";
}

std::string Pair::start() {
  if (!board_) return "no shared memory";
  spawn("receiver");
  if (auto failure = ask(false, Order::wait_ready); !failure.empty()) return failure;
  spawn("sender");
  if (auto failure = ask(true, Order::wait_ready); !failure.empty()) return failure;
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  Figures ignored;
  return run(24, 2'000'000, ignored);  // grows every pool and the readers' histories
}

std::string Pair::run(std::uint32_t count, std::int64_t period_ns, Figures& figures) {
  while (sem_trywait(&board_->credits) == 0) {
  }
  for (unsigned i = 0; i < window; ++i) sem_post(&board_->credits);
  board_->sender.count = count;
  board_->sender.period_ns = period_ns;
  for (const Order order : {Order::begin, Order::send, Order::end}) {
    if (order == Order::end) {  // what is on the way arrives
      for (int i = 0; i < 200 && board_->handled < board_->sender.figures.messages; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
    for (const bool sender : {false, true}) {
      if (order == Order::send && !sender) continue;
      if (auto failure = ask(sender, order); !failure.empty()) return failure;
    }
  }
  figures.sender = board_->sender.figures;
  figures.receiver = board_->receiver.figures;
  const std::size_t measured = std::min<std::size_t>(figures.receiver.messages, board_->latency_ns.size());
  figures.latency_us.assign(board_->latency_ns.begin(), board_->latency_ns.begin() + static_cast<long>(measured));
  for (double& latency : figures.latency_us) latency /= 1000;
  return measured > 0 ? "" : peer_.implementation + " on " + peer_.vendor + ": nothing arrived";
}

}  // namespace adit::bench
