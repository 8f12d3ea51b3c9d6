// Bad input of every kind, between good frames: shared by the unit test (few frames) and the slow one (many).
#pragma once

#include <cstdint>

namespace adit::thermal_odometry {

// Inside a test: fails it unless every answer is finite and one frame in twenty is tracked all the same.
void survive_fuzzed_frames(int frames, std::uint32_t seed);

}  // namespace adit::thermal_odometry
