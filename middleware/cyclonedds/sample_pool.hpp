// Memory of samples, recycled by size so that a steady stream of clouds allocates nothing.
#pragma once

#include <cstddef>

namespace adit::cyclonedds {

// A block of at least `size` bytes, aligned to 16; `capacity` gets what the block really holds. Null: out of memory.
// Any thread.
void* take_block(std::size_t size, std::size_t& capacity) noexcept;
// Gives a block back; `capacity` is what take_block reported. Any thread, also after every participant is gone.
void return_block(void* block, std::size_t capacity) noexcept;

}  // namespace adit::cyclonedds
