// Loops over independent blocks on a given number of threads. Results must not depend on the split.
#pragma once

#include <cstddef>
#include <functional>

namespace adit::tunnel_simulator {

// Calls body(i) for each i in [0, count), on at most `threads` threads (the caller is one of them).
void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body);

// Calls body(); libraries that use TBB in it (Embree's builders) get at most `threads` threads.
void with_threads(int threads, const std::function<void()>& body);

}  // namespace adit::tunnel_simulator
