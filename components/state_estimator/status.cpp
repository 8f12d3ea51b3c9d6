#include "components/state_estimator/status.hpp"

namespace adit::state_estimator {

const char* to_string(Mode mode) {
  switch (mode) {
    case Mode::initializing:
      return "initializing";
    case Mode::fused:
      return "fused";
    case Mode::lidar:
      return "lidar";
    case Mode::thermal:
      return "thermal";
    case Mode::other:
      return "other";
    case Mode::dead_reckoning:
      return "dead_reckoning";
  }
  return "?";
}

SensorReport report_of(const std::string& name, const SensorState& s, std::int64_t now_ns, double outage_s) {
  SensorReport r;
  r.name = name;
  if (s.last_accepted_ns != kNoStamp) r.age_s = seconds_between(s.last_accepted_ns, now_ns);
  r.distrusted = s.is_distrusted;
  r.healthy = s.last_accepted_ns != kNoStamp && r.age_s <= outage_s && !s.is_distrusted;
  r.nis = s.nis;
  r.nis_dof = s.nis_dof;
  r.mean_nis_per_dof = s.examined > 0 ? s.nis_per_dof_sum / static_cast<double>(s.examined) : 0.0;
  r.noise_factor = s.noise.factor;
  const bool recent = s.window.stamp_ns != kNoStamp && seconds_between(s.window.stamp_ns, now_ns) <= outage_s;
  r.suspicion = recent ? s.window.suspicion : 0.0;
  r.accepted = s.accepted;
  r.rejected = s.rejected;
  r.distrusted_count = s.distrusted;
  r.unanchored = s.unanchored;
  r.uninformative = s.uninformative;
  r.forced = s.forced;
  return r;
}

}  // namespace adit::state_estimator
