#include "components/tunnel_simulator/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace adit::tunnel_simulator {
namespace {

#ifdef __SANITIZE_THREAD__
// ThreadSanitizer does not see how Debian's libtbb hands work over: for it, the same loop on plain threads.
void run_parallel(int threads, std::size_t count, const std::function<void(std::size_t)>& body) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next.fetch_add(1); i < count; i = next.fetch_add(1)) body(i);
  };
  std::vector<std::jthread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work);
  work();
}
#else
void run_parallel(int, std::size_t count, const std::function<void(std::size_t)>& body) {
  tbb::parallel_for(std::size_t{0}, count, body);
}
#endif

}  // namespace

void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body) {
  with_threads(threads, [&] {
    if (threads <= 1 || count <= 1) {
      for (std::size_t i = 0; i < count; ++i) body(i);
    } else {
      run_parallel(threads, count, body);
    }
  });
}

void with_threads(int threads, const std::function<void()>& body) {
  tbb::task_arena arena(std::max(1, threads));
  arena.execute(body);
}

}  // namespace adit::tunnel_simulator
