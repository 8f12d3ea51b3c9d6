// What the filter starts from.
#pragma once

#include <cstdint>

#include "components/state_estimator/config.hpp"
#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

FilterState initial_state(const Config& config, std::int64_t stamp_ns);

// The pose and calibration of `old`, none of its motion, clones and stamps: after a jump of the clock or a long
// silence.
FilterState without_motion(const FilterState& old, const Config& config, std::int64_t stamp_ns);

}  // namespace adit::state_estimator
