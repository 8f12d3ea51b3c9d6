// A drive to and fro through the test corridor as messages, interrupted by episodes of bad input of every kind the
// component can be given, and what must hold all the same. Shared by the unit test (a few thousand frames) and by
// thermal_odometry_fuzz (as many as wanted).
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "idl/result.hpp"

namespace adit::thermal_odometry {

enum class Fault : std::uint8_t {
  // The picture says nothing; none of these frames may be measured.
  noise,           // uniform in 16 bits
  weak_noise,      // the detector's noise alone
  black,           // all 0
  saturated,       // all at the limit
  duplicate,       // the last good picture again, new stamp
  shutter,         // the same with the camera's word for it
  eight_bit_low,   // 8-bit values
  eight_bit_high,  // 8-bit values in the upper byte
  wrong_size,      // another resolution
  malformed,       // sizes, steps and lengths at random
  reordered,       // stamps run backwards from frame to frame
  // The picture may still show the scene: being measured is allowed, being wrong about it is not asked.
  blocks,       // every other block lost
  inverted,     // hot and cold exchanged
  dead_pixels,  // one in twenty at a limit
  gain_jump,    // another gain and offset in each frame
  dropped,      // frames missing
  // Not the picture but what comes with it.
  clock_back,      // stamps of everything by minutes, and so from then on
  clock_forward,   // same
  stamp_spike,     // one frame stamped an hour ahead
  telemetry,       // readout, integration and FFC fields at random, not finite
  cloud_nan,       // all points NaN
  cloud_scaled,    // points moved at random
  cloud_absent,    // none
  cloud_mutated,   // fields, steps and bytes at random
  cloud_stamps,    // hours away
  prior_wild,      // NaN, huge, negative variances
  camera_info,     // another focal length, then the right one again
  camera_invalid,  // NaN, zero, unknown model
};
inline constexpr int fault_count = 28;
std::string_view to_string(Fault fault);

struct FuzzFigures {
  int frames = 0;
  int good = 0;            // frames between the episodes
  int good_measured = 0;   // of them
  int measured_wrong = 0;  // of them, 10 frames or more after a fault: off by more than 0.5 m/s and 10 sigma
  int not_finite = 0;      // messages
  int false_motion = 0;    // frames without a scene that were measured
  struct OfFault {
    int episodes = 0;
    int frames = 0;
    int measured = 0;
    int recovered = 0;        // episodes after which a good frame was measured
    int longest = 0;          // good frames until then
    double sum_recovery = 0;  // of the same
  };
  std::array<OfFault, fault_count> faults{};
};

// Errors: the component ended the run, which is what it must not do.
Result<FuzzFigures> run_fuzzed_component_drive(int frames, std::uint32_t seed);

// One line a fault, for people.
void print(const FuzzFigures& figures);

}  // namespace adit::thermal_odometry
