// Makes the registry's entry of a type; for the generated sources.
#pragma once

#include "idl/type_registry.hpp"

namespace adit::registry {

template <Message T>
DecodeStatus to_json(Bytes payload, std::string& out, const JsonOptions& options) {
  T message;
  const DecodeStatus status = decode(payload, message);
  if (status == DecodeStatus::ok) JsonWriter(out, options).write(message);
  return status;
}

template <Message T>
DecodeStatus reencode(Bytes payload, std::vector<std::byte>& out) {
  T message;
  const DecodeStatus status = decode(payload, message);
  if (status != DecodeStatus::ok) return status;
  out.resize(encoded_size(message));
  encode(message, out);
  return status;
}

template <Message T>
std::vector<std::byte> default_sample() {
  const T message;
  std::vector<std::byte> out(encoded_size(message));
  encode(message, out);
  return out;
}

template <Message T>
MessageType message_type(std::string_view variant) {
  return {&type_info<T>(), variant, &to_json<T>, &reencode<T>, &default_sample<T>};
}

}  // namespace adit::registry
