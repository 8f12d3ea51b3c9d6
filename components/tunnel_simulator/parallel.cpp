#include "components/tunnel_simulator/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace adit::tunnel_simulator {

void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body) {
  with_threads(threads, [&] {
    if (threads <= 1 || count <= 1) {
      for (std::size_t i = 0; i < count; ++i) body(i);
    } else {
      tbb::parallel_for(std::size_t{0}, count, body);
    }
  });
}

void with_threads(int threads, const std::function<void()>& body) {
  tbb::task_arena arena(std::max(1, threads));
  arena.execute(body);
}

}  // namespace adit::tunnel_simulator
