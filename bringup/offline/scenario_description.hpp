// What a report says about the scenario a run was made from.
#pragma once

#include <string>

#include "bringup/evaluation/evaluation.hpp"
#include "bringup/evaluation/report.hpp"
#include "idl/result.hpp"

namespace adit::offline {

// Sets title, description, the table of inputs, the map and the outages of `report`, and the centre line (one lap of
// the route) of `options`.
Result<void> describe_scenario(const std::string& path, evaluation::Options& options,
                               evaluation::ReportOptions& report);

// "car" or "legged": the calibration file its rig belongs to. "car" when the file cannot be read.
std::string vehicle_of(const std::string& path);

}  // namespace adit::offline
