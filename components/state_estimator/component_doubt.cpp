#include "components/state_estimator/component_doubt.hpp"

#include <algorithm>

#include "adit_msgs/msg/localizability.hpp"
#include "adit_msgs/msg/thermal_health.hpp"
#include "components/runtime/stamp.hpp"

namespace adit::state_estimator {

using adit_msgs::msg::Localizability;
using adit_msgs::msg::ThermalHealth;

void LidarDoubt::update(const Localizability& message) {
  constexpr double forgotten = 0.998;  // a sweep: half of it after 35 s at 10 Hz, when the tunnel has become another
  const double matched = message.correspondences;
  usual_ = std::max(matched, forgotten * usual_);
  doubt_.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  doubt_.value = usual_ > 0.0 ? std::clamp(1.0 - 2.0 * matched / usual_, 0.0, 1.0) : 0.0;
}

Doubt doubt_of(const ThermalHealth& message) {
  Doubt doubt;
  doubt.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  constexpr float misfit = 1.3F;  // noise units: a right alignment leaves less than one
  // Of fewer points one step is off by 5 to 20 of its own sigmas in fog, which leaves only what moves along with the
  // camera; where 150 are tracked it is off by 1 to 3 there and elsewhere (bringup/doc/experiment.md).
  constexpr std::uint32_t enough_points = 100;
  const bool measured = message.state == ThermalHealth::OK;
  if (message.residual_rms > misfit || (measured && message.active_points < enough_points)) {
    doubt.value = 1.0;
  } else if (message.state != ThermalHealth::OK) {
    doubt.value = 0.75;
  } else if ((message.flags & (ThermalHealth::FLAG_ALONG_TRACK_WEAK | ThermalHealth::FLAG_SATURATED)) != 0) {
    doubt.value = 0.5;
  } else if ((message.flags & ThermalHealth::FLAG_WEAK_TEXTURE) != 0) {
    doubt.value = 0.25;
  }
  return doubt;
}

}  // namespace adit::state_estimator
