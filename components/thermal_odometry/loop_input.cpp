#include "components/thermal_odometry/loop_input.hpp"

#include <algorithm>
#include <cstdlib>

namespace adit::thermal_odometry {

LoopInput::LoopInput(const CameraModel& camera, const Config& config)
    : config_(config),
      width_(camera.width),
      height_(camera.height),
      rectifier_(camera),
      clouds_(config.max_cloud_points, config.max_cloud_age_s),
      anchor_(pinhole_of(camera), camera.width, camera.height, config.max_cloud_points, config.anchor) {
  for (Image* image : {&raw_, &image_}) {
    image->width = width_;
    image->height = height_;
    image->pixels.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  }
}

void LoopInput::clear() {
  history_.clear();
  for (Picture& picture : pictures_) picture.used = false;
  all_known_ = false;
}

void LoopInput::add_frame(const Frame& frame) {
  if (frame.data == nullptr || frame.width != width_ || frame.height != height_) return;
  const int stride = frame.stride > 0 ? frame.stride : frame.width;
  if (stride < frame.width) return;
  Picture& picture = pictures_[next_picture_];
  next_picture_ = (next_picture_ + 1) % pictures_.size();
  picture.stamp_ns = frame.stamp_ns;
  picture.used = true;
  picture.counts.resize(raw_.pixels.size());
  for (int y = 0; y < height_; ++y) {
    const std::uint16_t* row = frame.data + static_cast<std::ptrdiff_t>(y) * stride;
    std::copy(row, row + width_, picture.counts.begin() + static_cast<std::ptrdiff_t>(y) * width_);
  }
}

const LoopInput::Picture* LoopInput::nearest(std::int64_t stamp_ns) const {
  const Picture* best = nullptr;
  for (const Picture& picture : pictures_) {
    if (!picture.used || std::llabs(picture.stamp_ns - stamp_ns) > config_.stamp_tolerance_ns) continue;
    if (best == nullptr || std::llabs(picture.stamp_ns - stamp_ns) < std::llabs(best->stamp_ns - stamp_ns))
      best = &picture;
  }
  return best;
}

bool LoopInput::add_pose(std::int64_t stamp_ns, const Pose& T_odom_camera, bool known) {
  if (!T_odom_camera.matrix().allFinite()) return false;
  all_known_ = all_known_ && known;
  if (!known || stamp_ns <= last_stamp_ns_) history_.clear();
  last_stamp_ns_ = stamp_ns;
  history_.add(stamp_ns, T_odom_camera.inverse());
  if (has_keyframe_) {
    const Pose moved = last_keyframe_.inverse() * T_odom_camera;
    const bool far = moved.translation().norm() >= config_.distance || so3_log(moved.linear()).norm() >= config_.angle;
    if (!far && all_known_) return false;
  }
  const Picture* picture = nearest(stamp_ns);
  if (picture == nullptr) return false;
  std::copy(picture->counts.begin(), picture->counts.end(), raw_.pixels.begin());
  if (rectifier_.identity()) {
    std::swap(image_.pixels, raw_.pixels);
  } else {
    rectifier_.apply(raw_.pixels.data(), image_.pixels.data());
  }
  detect_corners(image_, config_.corners, corners_, descriptors_);
  anchor_.project(clouds_.at(stamp_ns, history_));
  with_depth_ = 0;
  for (Corner& corner : corners_) {
    const auto depth = anchor_.depth_at(corner.u, corner.v);
    if (!depth) continue;
    corner.depth = 1.0F / depth->inverse_depth;
    ++with_depth_;
  }
  keyframe_known_ = all_known_;
  all_known_ = true;
  has_keyframe_ = true;
  last_keyframe_ = T_odom_camera;
  return true;
}

}  // namespace adit::thermal_odometry
