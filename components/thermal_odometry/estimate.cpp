#include "components/thermal_odometry/estimate.hpp"

namespace adit::thermal_odometry {

const char* to_string(Status status) {
  switch (status) {
    case Status::initialising:
      return "initialising";
    case Status::tracking:
      return "tracking";
    case Status::frozen:
      return "frozen";
    case Status::ffc:
      return "shutter closed";
    case Status::low_texture:
      return "not enough texture";
    case Status::recovering:
      return "recovering";
    case Status::invalid_frame:
      return "invalid frame";
  }
  return "?";
}

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::good:
      return "good";
    case Verdict::wrong_size:
      return "of another size";
    case Verdict::bad_stamp:
      return "not newer";
    case Verdict::ffc:
      return "with the shutter closed";
    case Verdict::frozen:
      return "frozen";
    case Verdict::uniform:
      return "uniform";
    case Verdict::saturated:
      return "saturated";
    case Verdict::eight_bit:
      return "of 8 bits";
  }
  return "?";
}

}  // namespace adit::thermal_odometry
