// Memory shared by the measuring process and the two processes it measures: orders one way, figures the other.
#pragma once

#include <semaphore.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace adit::bench {

enum class Order : std::uint32_t {
  wait_ready,  // sender: a reader is matched; receiver: it listens
  begin,       // figures start from zero
  send,        // sender: `count` messages, one each `period_ns`; with period 0 as many as `credits` allow
  end,         // figures are complete
  quit,
};

// Both sides fill it in at `end`.
struct SideFigures {
  double cpu_us;                   // of the whole process, user and system, since `begin`
  std::uint64_t messages;          // sent or handled
  std::uint64_t failed;            // sender: refused by publish()
  std::uint64_t allocations;       // receiver: in the thread that handles, since `begin`
  std::uint64_t copied;            // receiver: messages whose blob is not a view of the received sample
  std::int64_t first_ns, last_ns;  // receiver: when the first and the last message was handled
};

struct Desk {
  sem_t ordered, done;
  Order order;
  std::uint32_t count;
  std::int64_t period_ns;
  bool ok;
  SideFigures figures;
};

struct Board {
  Desk sender, receiver;
  sem_t credits;  // messages the sender may still have on the way; only while period_ns is 0
  std::atomic<std::uint32_t> handled;
  std::array<std::uint32_t, 20'000> latency_ns;  // of the first messages since `begin`
};

// What a measured process is; it travels as command-line words.
struct Peer {
  std::string role;            // "sender" | "receiver"
  std::string implementation;  // "runtime" | "bare" | "bare_listener"
  std::string vendor;
  std::uint32_t domain = 0;
  std::size_t bytes = 0;
};

// The hidden sub-command: takes orders from the board behind file descriptor `board` until `quit`. Exit code.
int run_peer(const Peer& peer, int board);

// A sender and a receiver process of one implementation, on a board of their own.
class Pair {
 public:
  Pair(const std::string& implementation, const std::string& vendor, std::uint32_t domain, std::size_t bytes);
  ~Pair();
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;

  struct Figures {
    SideFigures sender, receiver;
    std::vector<double> latency_us;
  };
  // Starts both and waits until they are matched and warm; what failed, or empty.
  std::string start();
  std::string run(std::uint32_t count, std::int64_t period_ns, Figures& figures);

 private:
  std::string ask(bool sender, Order order);
  void spawn(const std::string& role);
  Peer peer_;
  int memory_ = -1;
  Board* board_ = nullptr;
  std::array<int, 2> processes_{-1, -1};
};

}  // namespace adit::bench
