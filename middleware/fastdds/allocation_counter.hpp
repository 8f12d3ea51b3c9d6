// Tests only: counts what passes through operator new.
#pragma once

#include <cstddef>

namespace adit::fastdds {

// Calls of operator new by the calling thread so far, those of modules included when the program exports its symbols.
std::size_t allocations_of_thread();

}  // namespace adit::fastdds
