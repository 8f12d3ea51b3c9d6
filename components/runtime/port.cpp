#include "components/runtime/port.hpp"

namespace adit {

std::string_view to_string(WhenFull when_full) {
  switch (when_full) {
    case WhenFull::drop_oldest:
      return "drop_oldest";
    case WhenFull::drop_newest:
      return "drop_newest";
    case WhenFull::block:
      return "block";
  }
  return "?";
}

std::string resolve_name(std::string_view name, std::string_view namespace_, std::string_view component) {
  if (name.starts_with('/')) return std::string(name);
  std::string full = "/";
  const auto append = [&full](std::string_view part) {
    while (part.starts_with('/')) part.remove_prefix(1);
    while (part.ends_with('/')) part.remove_suffix(1);
    if (part.empty()) return;
    if (full.size() > 1) full += '/';
    full += part;
  };
  append(namespace_);
  if (name.starts_with('~')) {
    append(component);
    name.remove_prefix(1);
  }
  append(name);
  return full;
}

}  // namespace adit
