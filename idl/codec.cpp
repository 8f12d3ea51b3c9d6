#include "idl/codec.hpp"

namespace adit {

std::string_view to_string(DecodeStatus status) {
  switch (status) {
    case DecodeStatus::ok:
      return "ok";
    case DecodeStatus::truncated:
      return "truncated";
    case DecodeStatus::length_exceeds_payload:
      return "length exceeds payload";
    case DecodeStatus::bad_encapsulation:
      return "bad encapsulation";
    case DecodeStatus::unterminated_string:
      return "unterminated string";
    case DecodeStatus::bad_boolean:
      return "bad boolean";
    case DecodeStatus::bound_exceeded:
      return "bound exceeded";
    case DecodeStatus::out_of_memory:
      return "out of memory";
  }
  return "unknown";
}

}  // namespace adit
