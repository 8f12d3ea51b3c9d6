// Messages with every kind of field filled, pseudo-random but the same every time; lengths differ with the seed.
#pragma once

#include <array>
#include <random>
#include <string>
#include <vector>

#include "idl/blob.hpp"
#include "idl/codec.hpp"

namespace adit::test {

class Filler {
 public:
  explicit Filler(unsigned seed) : random_(seed) {}

  template <class T>
  void operator()(const char*, T& value) {
    fill(value);
  }
  template <Message T>
  void fill(T& message) {
    for_each_field(message, *this);
  }

 private:
  template <class T>
  requires std::is_arithmetic_v<T>
  void fill(T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      value = static_cast<T>(static_cast<int>(random_())) / 7;
    } else if constexpr (std::is_same_v<T, bool>) {
      value = random_() % 2 == 1;
    } else {
      value = static_cast<T>(random_());
    }
  }
  void fill(std::string& text) {
    text.resize(length());
    for (char& c : text) c = static_cast<char>('a' + random_() % 26);
  }
  void fill(Blob& blob) {
    blob.resize(length());
    for (std::size_t i = 0; i < blob.size(); ++i) blob.mutable_data()[i] = static_cast<std::uint8_t>(random_());
  }
  void fill(std::vector<bool>& values) {
    values.resize(length());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = random_() % 2 == 1;
  }
  template <class T, std::size_t N>
  void fill(std::array<T, N>& values) {
    for (T& value : values) fill(value);
  }
  template <class T>
  void fill(std::vector<T>& values) {
    values.resize(length());
    for (T& value : values) fill(value);
  }
  std::size_t length() { return random_() % 8; }

  std::mt19937 random_;
};

}  // namespace adit::test
