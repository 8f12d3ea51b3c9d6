#include "idl/allocation_count_test.hpp"

#include <algorithm>
#include <cstdlib>
#include <new>

namespace adit {

AllocationCount& allocation_count() {
  thread_local AllocationCount count;
  return count;
}

}  // namespace adit

void* operator new(std::size_t size) {
  adit::AllocationCount& count = adit::allocation_count();
  ++count.calls;
  count.bytes += size;
  count.largest = std::max(count.largest, size);
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}

void operator delete(void* memory) noexcept {
  std::free(memory);
}

void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
