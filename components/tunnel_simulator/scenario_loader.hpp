// Scenario and world files (bringup/scenarios/*.yaml, worlds/*.yaml) to values. The files document the keys.
#pragma once

#include <string>

#include "components/tunnel_simulator/scenario.hpp"
#include "idl/result.hpp"

namespace adit::tunnel_simulator {

// Reads the scenario and the world file it names (relative to the scenario's folder). Mistakes (unknown key, value out
// of range, unknown tube, route outside the tunnel) come as "file:line: what and where".
Result<Scenario> load_scenario(const std::string& path);

// Only the world, at feature level F0..F2 and texture level TT0..TT3.
Result<WorldDescription> load_world(const std::string& path, int features, int texture, std::uint64_t seed);

}  // namespace adit::tunnel_simulator
