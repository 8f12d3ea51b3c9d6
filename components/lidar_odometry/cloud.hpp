// A sweep of a LiDAR as the odometry reads it: views on memory that the caller owns, so that a received message is not
// copied. All views of one cloud have the same size, one element a point, in one common order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include <Eigen/Core>

namespace adit::lidar_odometry {

// Elements of T that lie `stride` bytes apart, at any alignment. Empty: the sweep has no such field.
template <class T>
class StridedView {
 public:
  StridedView() = default;
  // `first`: the first element. Precondition: [first, first + (size - 1) * stride + sizeof(T)) is readable.
  StridedView(const void* first, std::size_t stride, std::size_t size)
      : first_(static_cast<const std::byte*>(first)), stride_(stride), size_(size) {}
  StridedView(std::span<const T> elements)  // NOLINT: implicit by intent
      : StridedView(elements.data(), sizeof(T), elements.size()) {}

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T operator[](std::size_t i) const {
    T element;
    std::memcpy(static_cast<void*>(&element), first_ + i * stride_, sizeof(T));
    return element;
  }

 private:
  const std::byte* first_ = nullptr;
  std::size_t stride_ = sizeof(T);
  std::size_t size_ = 0;
};

// Three consecutive floats: x, y, z.
using Point3f = Eigen::Vector3f;

struct Cloud {
  // Start of the sweep; the zero of the point times.
  std::int64_t stamp_ns = 0;

  // Cartesian coordinates [m] in the sensor frame (x forward, y left, z up), each at its own firing time, or all at the
  // stamp if the driver has already compensated the motion (then give no times). NaN, Inf and (0,0,0) mark "no return";
  // they are counted and skipped.
  StridedView<Point3f> points;

  // Firing time after the stamp. At most one of the two is used, seconds first; none: no motion compensation.
  StridedView<float> seconds;
  StridedView<std::uint32_t> nanoseconds;

  // Laser index of each point, 0 = any outermost one. Helps clouds that are not organised; estimated if absent.
  StridedView<std::uint16_t> rings;

  // Organised cloud: point (row, column) is element row * width + column, a row is a ring, columns are in azimuth
  // order, points.size() == width * height. height <= 1: not organised.
  std::size_t width = 0;
  std::size_t height = 1;
};

}  // namespace adit::lidar_odometry
