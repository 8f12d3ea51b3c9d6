// Counts what operator new hands out on the calling thread; for test programs that link allocation_count_test.cpp.
#pragma once

#include <cstddef>

namespace adit {

struct AllocationCount {
  std::size_t calls = 0;
  std::size_t bytes = 0;    // handed out since reset, freed or not
  std::size_t largest = 0;  // single request
};

AllocationCount& allocation_count();

}  // namespace adit
