// Between the library's structs and messages.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "components/state_estimator/state_estimator.hpp"

namespace adit::adit_msgs::msg {
struct FusionStatus;
}
namespace adit::nav_msgs::msg {
struct Odometry;
}

namespace adit::state_estimator {

// What the estimator does not keep of an input.
struct Arrival {
  std::int64_t last_ns = kNoStamp;  // when its last message came
  std::uint64_t late = 0;           // fused out of order
};
enum Input : std::size_t { kLidarInput, kThermalInput, kImuInput, kGnssInput, kInputs };
using Arrivals = std::array<Arrival, kInputs>;

// nav_msgs/Odometry has the covariance about the axes of the parent frame; the estimator takes the information of the
// right perturbation. All zero means unknown; what is no covariance is not used either. `rotation`: the pose's.
std::optional<Matrix6d> reported_information(const nav_msgs::msg::Odometry& message, const Eigen::Matrix3d& rotation);

// Pose, twist and covariances; not header and frames. Height, roll and pitch get a variance of 1e6: they are carried
// along, not filtered.
void fill(const Estimate& estimate, nav_msgs::msg::Odometry& out);

// True when some sensor has been fused.
bool began(const Status& status);

// Everything but header and distance. Reuses the message's memory.
void fill(const Estimate& estimate, const Status& status, const Arrivals& arrivals, const Config& config,
          std::int64_t now_ns, adit_msgs::msg::FusionStatus& out);

}  // namespace adit::state_estimator
