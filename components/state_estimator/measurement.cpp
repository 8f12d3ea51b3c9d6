#include "components/state_estimator/measurement.hpp"

#include <tuple>

namespace adit::state_estimator {

bool processed_before(const Measurement& a, const Measurement& b) {
  return std::tuple(a.stamp_ns, a.kind, a.sensor, a.anchor_ns) < std::tuple(b.stamp_ns, b.kind, b.sensor, b.anchor_ns);
}

}  // namespace adit::state_estimator
