#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

void FilterState::clone(int slot) {
  constexpr int pose[3] = {kX, kY, kYaw};
  const int first = clone_index(slot);
  for (int i = 0; i < 3; ++i) x(first + i) = x(pose[i]);
  // Rows first, then columns: the second copy also moves the block that belongs to the clone itself.
  for (int i = 0; i < 3; ++i) p.row(first + i) = p.row(pose[i]);
  for (int i = 0; i < 3; ++i) p.col(first + i) = p.col(pose[i]);
  clone_stamp_ns[static_cast<std::size_t>(slot)] = stamp_ns;
}

void FilterState::drop_clone(int slot) {
  const int first = clone_index(slot);
  x.segment<3>(first).setZero();
  p.middleRows<3>(first).setZero();
  p.middleCols<3>(first).setZero();
  clone_stamp_ns[static_cast<std::size_t>(slot)] = kNoStamp;
}

}  // namespace adit::state_estimator
