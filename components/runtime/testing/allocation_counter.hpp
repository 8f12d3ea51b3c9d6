// Counts heap allocations of the test program that links adit_allocation_counter (it replaces operator new).
#pragma once

#include <cstdint>

namespace adit::testing {

// Of the calling thread, since it started.
std::uint64_t allocations_of_this_thread();
// Of all threads.
std::uint64_t allocations();

}  // namespace adit::testing
