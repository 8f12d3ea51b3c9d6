// The C++ types of IDL sequence<T, N> and string<N>.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace adit {

// The type carries the bound; it is checked where it matters, on the wire: encode() refuses what exceeds it, decode()
// rejects it.
template <class T, std::size_t N>
struct BoundedVector : std::vector<T> {
  using std::vector<T>::vector;
};

template <std::size_t N>
struct BoundedString : std::string {
  using std::string::string;
  BoundedString() = default;
  BoundedString(std::string text) : std::string(std::move(text)) {}  // NOLINT: implicit by intent
};

}  // namespace adit
