#include "idl/testing/allocation_counter.hpp"

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <utility>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ADIT_SANITIZER_ALLOCATES
// Of GCC's and Clang's sanitizer runtimes; GCC does not install the header it is declared in.
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*)(const volatile void*, std::size_t),
                                                         void (*)(const volatile void*));
#endif

namespace adit::test {
namespace {

std::atomic<std::uint64_t> total{0};
thread_local std::uint64_t calls_of_thread = 0, bytes_of_thread = 0;
thread_local AllocationObserver observer_of_thread = nullptr;

void count(std::size_t size, const void* caller) {
  ++calls_of_thread;
  bytes_of_thread += size;
  total.fetch_add(1, std::memory_order_relaxed);
  if (AllocationObserver const observer = std::exchange(observer_of_thread, nullptr)) {
    observer(caller);
    observer_of_thread = observer;
  }
}

}  // namespace

std::uint64_t allocations_of_this_thread() {
  return calls_of_thread;
}

std::uint64_t allocated_bytes_of_this_thread() {
  return bytes_of_thread;
}

std::uint64_t allocations() {
  return total.load(std::memory_order_relaxed);
}

void observe_allocations_of_this_thread(AllocationObserver observer) {
  observer_of_thread = observer;
}

#ifdef ADIT_SANITIZER_ALLOCATES

namespace {

void on_malloc(const volatile void*, std::size_t size) {
  count(size, __builtin_return_address(0));
}
void on_free(const volatile void*) {}
[[maybe_unused]] const int installed = __sanitizer_install_malloc_and_free_hooks(&on_malloc, &on_free);

}  // namespace
}  // namespace adit::test

#else

}  // namespace adit::test

// The program's own definitions take the place of glibc's, also for its shared libraries; free() stays glibc's.
extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  adit::test::count(size, __builtin_return_address(0));
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) noexcept {
  adit::test::count(count * size, __builtin_return_address(0));
  return __libc_calloc(count, size);
}

void* realloc(void* memory, std::size_t size) noexcept {
  adit::test::count(size, __builtin_return_address(0));
  return __libc_realloc(memory, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  adit::test::count(size, __builtin_return_address(0));
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) noexcept {
  adit::test::count(size, __builtin_return_address(0));
  void* const found = __libc_memalign(alignment, size);
  if (!found) return ENOMEM;
  *memory = found;
  return 0;
}

}  // extern "C"

#endif
