// The clouds of a recorded folder as the mapping reads them.
#pragma once

#include <string>

#include "components/dataset/dataset.hpp"
#include "components/mapping/sweep_buffer.hpp"

namespace adit {

// Times are seconds after the sweep's start where the file has them, intensity 0 where it has none.
Result<mapping::OwnedSweep> read_sweep(const dataset::Dataset& dataset, std::size_t index);

}  // namespace adit
