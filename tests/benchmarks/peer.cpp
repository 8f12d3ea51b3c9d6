#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <ctime>
#include <thread>

#include "idl/testing/allocation_counter.hpp"
#include "tests/benchmarks/board.hpp"
#include "tests/benchmarks/runtime_side.hpp"
#include "tests/benchmarks/wait.hpp"

namespace adit::bench {

std::int64_t monotonic_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000'000LL + now.tv_nsec;
}

namespace {

double cpu_us() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto us = [](const timeval& time) { return static_cast<double>(time.tv_sec) * 1e6 + time.tv_usec; };
  return us(usage.ru_utime) + us(usage.ru_stime);
}

void sleep_until(std::int64_t ns) {
  const timespec until{ns / 1'000'000'000, ns % 1'000'000'000};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

std::unique_ptr<Sender> make_sender(const Peer& peer) {
  if (peer.implementation == "runtime") return make_runtime_sender(peer.vendor, peer.domain, peer.bytes);
#ifdef ADIT_BENCH_cyclonedds
  if (peer.vendor == "cyclonedds") return make_bare_cyclonedds_sender(peer.domain, peer.bytes);
#endif
#ifdef ADIT_BENCH_fastdds
  if (peer.vendor == "fastdds") return make_bare_fastdds_sender(peer.domain, peer.bytes);
#endif
  return nullptr;
}

std::unique_ptr<Receiver> make_receiver(const Peer& peer, std::uint64_t& copied, OnMessage on_message) {
  if (peer.implementation == "runtime") {
    return make_runtime_receiver(peer.vendor, peer.domain, copied, std::move(on_message));
  }
  [[maybe_unused]] const TakeIn take_in =
      peer.implementation == "bare_listener" ? TakeIn::vendor_thread : TakeIn::own_thread;
#ifdef ADIT_BENCH_cyclonedds
  if (peer.vendor == "cyclonedds") {
    return make_bare_cyclonedds_receiver(peer.domain, peer.bytes, take_in, std::move(on_message));
  }
#endif
#ifdef ADIT_BENCH_fastdds
  if (peer.vendor == "fastdds") {
    return make_bare_fastdds_receiver(peer.domain, peer.bytes, take_in, std::move(on_message));
  }
#endif
  return nullptr;
}

template <class Obey>
int obey_orders(Desk& desk, Obey obey) {
  while (true) {
    while (sem_wait(&desk.ordered) != 0) {
    }
    desk.ok = desk.order == Order::quit || obey(desk);
    const bool last = desk.order == Order::quit;
    sem_post(&desk.done);
    if (last) return 0;
  }
}

int run_sender(const Peer& peer, Board& board) {
  const auto sender = make_sender(peer);
  double cpu_at_begin = 0;
  return obey_orders(board.sender, [&](Desk& desk) {
    SideFigures& figures = desk.figures;
    switch (desk.order) {
      case Order::wait_ready:
        for (int i = 0; sender && !sender->matched() && i < 2000; ++i) {
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        return sender && sender->matched();
      case Order::begin:
        figures = {};
        cpu_at_begin = cpu_us();
        return true;
      case Order::send: {
        std::int64_t next = monotonic_ns();
        for (std::uint32_t i = 0; i < desk.count; ++i) {
          if (desk.period_ns > 0) {
            sleep_until(next += desk.period_ns);
          } else {
            wait_for(board.credits, std::chrono::milliseconds(200));  // a lost message costs this
          }
          if (!sender->send()) ++figures.failed;
          ++figures.messages;
        }
        return true;
      }
      case Order::end:
        figures.cpu_us = cpu_us() - cpu_at_begin;
        return true;
      default:
        return false;
    }
  });
}

int run_receiver(const Peer& peer, Board& board) {
  // Of the thread that handles; atomic for the one that takes orders.
  std::atomic<std::uint64_t> allocations{0};
  std::atomic<std::int64_t> first{0}, last{0};
  std::uint64_t copied = 0;
  const auto receiver = make_receiver(peer, copied, [&](std::int64_t sent) {
    const std::int64_t now = monotonic_ns();
    const std::uint32_t number = board.handled.load(std::memory_order_relaxed);
    if (number < board.latency_ns.size()) board.latency_ns[number] = static_cast<std::uint32_t>(now - sent);
    if (number == 0) first = now;
    last = now;
    allocations = test::allocations_of_this_thread();
    board.handled.store(number + 1, std::memory_order_release);
    sem_post(&board.credits);
  });
  double cpu_at_begin = 0;
  std::uint64_t allocations_at_begin = 0, copied_at_begin = 0;
  return obey_orders(board.receiver, [&](Desk& desk) {
    SideFigures& figures = desk.figures;
    switch (desk.order) {
      case Order::wait_ready:
        return receiver != nullptr;
      case Order::begin:
        figures = {};
        board.handled = 0;
        allocations_at_begin = allocations;
        copied_at_begin = copied;
        cpu_at_begin = cpu_us();
        return true;
      case Order::end:
        figures.cpu_us = cpu_us() - cpu_at_begin;
        figures.messages = board.handled;
        figures.allocations = allocations - allocations_at_begin;
        figures.copied = copied - copied_at_begin;
        figures.first_ns = first;
        figures.last_ns = last;
        return true;
      default:
        return false;
    }
  });
}

}  // namespace

int run_peer(const Peer& peer, int memory) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  void* const mapped = mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
  if (mapped == MAP_FAILED) return 1;
  Board& board = *static_cast<Board*>(mapped);
  return peer.role == "sender" ? run_sender(peer, board) : run_receiver(peer, board);
}

}  // namespace adit::bench
