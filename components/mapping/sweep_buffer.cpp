#include "components/mapping/sweep_buffer.hpp"

namespace adit::mapping {

bool SweepBuffer::add(const StampedPose& pose) {
  if (!pose.pose.matrix().allFinite()) return false;
  if (!poses_.empty() && pose.stamp_ns <= poses_.back().stamp_ns) return false;
  if (poses_.size() == most_poses) poses_.erase(poses_.begin(), poses_.begin() + most_poses / 2);
  poses_.push_back(pose);
  return true;
}

bool SweepBuffer::add(OwnedSweep sweep) {
  sweeps_.push_back(std::move(sweep));
  if (sweeps_.size() <= most_sweeps) return false;
  sweeps_.pop_front();
  return true;
}

std::optional<OwnedSweep> SweepBuffer::next() {
  if (sweeps_.empty() || poses_.empty()) return std::nullopt;
  if (poses_.back().stamp_ns < end_ns(sweeps_.front().view()) - instant_tolerance_ns) return std::nullopt;
  OwnedSweep sweep = std::move(sweeps_.front());
  sweeps_.pop_front();
  return sweep;
}

void SweepBuffer::clear() {
  poses_.clear();
  sweeps_.clear();
}

}  // namespace adit::mapping
