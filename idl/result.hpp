// Errors as values. A run-time failure that a caller can meet is returned, never thrown; the message says what
// happened, to what, and what to do about it, because it is what the user gets to read.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace adit {

enum class ErrorCode {
  invalid_argument,  // the caller's value is wrong
  not_found,         // no such file, type, component, vendor, ...
  unavailable,       // exists but cannot be used now (port in use, no permission, not matched, ...)
  incompatible,      // both sides are fine, but not together (QoS, type, version)
  out_of_resources,
  timeout,
  io,
  malformed,  // bytes or text that do not follow their format
  internal,   // ours: report it
};

struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string message;
};

// Either a value or an Error. `if (!result) return result.error();` hands an error on.
template <class T = void>
class [[nodiscard]] Result {
 public:
  Result(T value) : content_(std::in_place_index<0>, std::move(value)) {}  // NOLINT: implicit by intent
  Result(Error error) : content_(std::in_place_index<1>, std::move(error)) {}

  explicit operator bool() const { return content_.index() == 0; }
  // Precondition: holds a value.
  T& value() & { return std::get<0>(content_); }
  const T& value() const& { return std::get<0>(content_); }
  T&& value() && { return std::get<0>(std::move(content_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  // Precondition: holds an error.
  const Error& error() const { return std::get<1>(content_); }

 private:
  std::variant<T, Error> content_;
};

// Success, or an Error. Success costs no allocation.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}  // NOLINT: implicit by intent

  explicit operator bool() const { return !error_; }
  // Precondition: holds an error.
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

}  // namespace adit
