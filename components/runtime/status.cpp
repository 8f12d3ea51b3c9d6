#include "components/runtime/status.hpp"

namespace adit {

std::string_view to_string(LifecycleState state) {
  switch (state) {
    case LifecycleState::unconfigured:
      return "unconfigured";
    case LifecycleState::inactive:
      return "inactive";
    case LifecycleState::active:
      return "active";
    case LifecycleState::finalized:
      return "finalized";
  }
  return "?";
}

std::string_view to_string(Health health) {
  static constexpr std::string_view names[] = {"ok", "warn", "error", "stale"};
  return names[static_cast<std::size_t>(health)];
}

}  // namespace adit
