// Messages as JSON text, for people and tests (`adit topic echo`): every field in IDL order, on one line.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "idl/blob.hpp"
#include "idl/codec.hpp"

namespace adit {

struct JsonOptions {
  // Longer arrays and sequences end with the string "... N more".
  std::size_t max_elements = std::numeric_limits<std::size_t>::max();
};

// Appends to `out`. Numbers read back to the same value: float as %.9g, double as %.17g, always with a point or
// exponent; what JSON cannot write is the string "nan", "inf" or "-inf". Bytes are an array of numbers. Text that is
// not UTF-8 shows U+FFFD.
class JsonWriter {
 public:
  explicit JsonWriter(std::string& out, const JsonOptions& options = {}) : out_(out), options_(options) {}

  template <class T>
  void operator()(const char* name, const T& value) {
    separate();
    out_ += '"';
    out_ += name;
    out_ += "\": ";
    write(value);
  }

  template <Message T>
  void write(const T& message) {
    open('{');
    for_each_field(message, *this);
    close('}');
  }
  void write(bool value) { out_ += value ? "true" : "false"; }
  void write(float value);
  void write(double value);
  template <std::integral T>
  void write(T value) {
    if constexpr (std::is_signed_v<T>) {
      write_signed(value);
    } else {
      write_unsigned(value);
    }
  }
  void write(std::string_view text);
  void write(const std::string& text) { write(std::string_view(text)); }
  void write(const Blob& blob) { write_elements<std::uint8_t>(blob); }
  template <class T, std::size_t N>
  void write(const std::array<T, N>& values) {
    write_elements<T>(values);
  }
  template <class T>
  void write(const std::vector<T>& values) {
    write_elements<T>(values);
  }

 private:
  void open(char bracket) {
    out_ += bracket;
    first_ = true;
  }
  void close(char bracket) {
    out_ += bracket;
    first_ = false;
  }
  void separate() {
    if (!first_) out_ += ", ";
    first_ = false;
  }
  void write_signed(std::int64_t value);
  void write_unsigned(std::uint64_t value);
  void write_omitted(std::size_t count);
  template <class T>
  void write_elements(const auto& values) {
    open('[');
    std::size_t written = 0;
    for (const T& value : values) {
      separate();
      if (written++ == options_.max_elements) {
        write_omitted(values.size() - options_.max_elements);
        break;
      }
      write(value);
    }
    close(']');
  }

  std::string& out_;
  JsonOptions options_;
  bool first_ = true;
};

}  // namespace adit
