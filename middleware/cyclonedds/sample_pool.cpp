#include "middleware/cyclonedds/sample_pool.hpp"

#include <array>
#include <bit>
#include <mutex>
#include <new>

namespace adit::cyclonedds {
namespace {

constexpr std::size_t smallest = 256;
constexpr std::size_t steps = 4;  // size classes per doubling: at most a quarter is wasted
constexpr std::size_t doublings = 24;
constexpr std::size_t kept_bytes = 64u << 20;  // idle memory held per size class; what is beyond goes back to the heap

struct FreeBlock {
  FreeBlock* next;
};

struct SizeClass {
  std::mutex mutex;
  FreeBlock* free = nullptr;
  std::size_t idle_bytes = 0;
};

// Smallest class that holds `size`: 256, 320, 384, 448, 512, 640, ...
std::size_t class_of(std::size_t size) {
  if (size <= smallest) return 0;
  const auto doubling = static_cast<std::size_t>(std::bit_width((size - 1) / smallest)) - 1;
  const std::size_t base = smallest << doubling;
  const std::size_t step = base / steps;
  return doubling * steps + (size - base + step - 1) / step;
}

std::size_t bytes_of(std::size_t index) {
  const std::size_t base = smallest << (index / steps);
  return base + base / steps * (index % steps);
}

// Never destroyed: samples may outlive every participant and static object.
std::array<SizeClass, doublings * steps>& classes() {
  static auto* const all = new std::array<SizeClass, doublings * steps>;
  return *all;
}

constexpr std::align_val_t alignment{16};

}  // namespace

void* take_block(std::size_t size, std::size_t& capacity) noexcept {
  const std::size_t index = class_of(size);
  if (index >= classes().size()) {
    capacity = size;
    return ::operator new(size, alignment, std::nothrow);
  }
  SizeClass& size_class = classes()[index];
  capacity = bytes_of(index);
  {
    const std::lock_guard lock(size_class.mutex);
    if (FreeBlock* const block = size_class.free) {
      size_class.free = block->next;
      size_class.idle_bytes -= capacity;
      return block;
    }
  }
  return ::operator new(capacity, alignment, std::nothrow);
}

void return_block(void* block, std::size_t capacity) noexcept {
  const std::size_t index = class_of(capacity);
  if (index < classes().size()) {
    SizeClass& size_class = classes()[index];
    const std::lock_guard lock(size_class.mutex);
    if (size_class.idle_bytes + capacity <= kept_bytes) {
      size_class.free = new (block) FreeBlock{size_class.free};
      size_class.idle_bytes += capacity;
      return;
    }
  }
  ::operator delete(block, alignment);
}

}  // namespace adit::cyclonedds
