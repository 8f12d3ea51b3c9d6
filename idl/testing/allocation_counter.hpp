// Counts the heap allocations of a test program that links adit_allocation_counter: malloc and its relatives, whoever
// calls them (operator new, Eigen, a vendor's C library), with and without sanitizers.
#pragma once

#include <cstdint>

namespace adit::test {

// Of the calling thread, since it started.
std::uint64_t allocations_of_this_thread();
std::uint64_t allocated_bytes_of_this_thread();
// Of all threads.
std::uint64_t allocations();

// Called with the return address of each allocation of the calling thread but those it makes itself; nullptr: no more.
using AllocationObserver = void (*)(const void* caller);
void observe_allocations_of_this_thread(AllocationObserver observer);

}  // namespace adit::test
