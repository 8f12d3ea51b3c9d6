// Reads the points of any sensor_msgs/PointCloud2 without knowing its layout: whatever fields, types, byte order and
// padding the driver chose.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "idl/result.hpp"

namespace adit::sensor_msgs::msg {
struct PointCloud2;
struct PointField;
}  // namespace adit::sensor_msgs::msg

namespace adit {

enum class PointTimeUnit { automatic, seconds, milliseconds, microseconds, nanoseconds, unused };

// The points of a cloud as separate arrays, all of one length; an array is empty when the cloud has no such field.
struct PointColumns {
  std::vector<float> x, y, z;        // m, frame of the cloud's header
  std::vector<float> intensity;      // as the sensor gives it
  std::vector<std::uint16_t> ring;   // laser, numbered as the sensor does
  std::vector<double> time;          // s relative to the header's stamp
  std::vector<std::uint32_t> index;  // row * width + column in the cloud
};

enum class NonFinitePoints { drop, keep };

// Refers to the cloud, which must outlive the view unchanged. Copyable, cheap. One cloud, any number of threads.
//
// Fields are found by name, the first that exists counts:
//   position   x, y, z (required)
//   intensity  intensity, i, reflectivity, signal, signal_photons
//   ring       ring, line, channel, laser_id, laser_number, row
//   time       t, time, timestamp, offset_time, time_offset, time_stamp, point_time_offset
// (Ouster: t; Velodyne: time; Livox: offset_time or timestamp, line; Hesai and RoboSense: timestamp.)
//
// Unit of the time field, unless given: a value too large for an offset within a scan is a time since the epoch, whose
// unit its magnitude tells (1e8 s, 1e11 ms, 1e14 us, 1e17 ns and above); it becomes relative to the header's stamp.
// Otherwise integers are nanoseconds since the stamp; floating-point values are seconds, since the stamp up to 5,
// since zero of the clock beyond. A time that is then not within a minute of the stamp is refused: other conventions
// (offsets as float microseconds, a sensor's own clock) must be named by the caller, or the field left unused.
class PointCloudView {
 public:
  // Refuses a cloud whose fields, steps and data do not fit together; the message says what does not.
  static Result<PointCloudView> of(const sensor_msgs::msg::PointCloud2& cloud,
                                   PointTimeUnit time_unit = PointTimeUnit::automatic);

  std::size_t size() const { return width_ * height_; }
  std::size_t width() const { return width_; }
  std::size_t height() const { return height_; }  // 1: not organized
  bool has_intensity() const { return intensity_.has_value(); }
  bool has_ring() const { return ring_.has_value(); }
  bool has_time() const { return time_.has_value(); }

  // Precondition of all: index < size() (row * width + column), and has_...().
  std::array<float, 3> position(std::size_t index) const;
  float intensity(std::size_t index) const;
  std::uint16_t ring(std::size_t index) const;
  double time(std::size_t index) const;

  // All points, or those whose x, y, z and time are finite. Reuses the memory of `out`.
  void copy_to(PointColumns& out, NonFinitePoints non_finite = NonFinitePoints::drop) const;

  // Any other field. Empty when the cloud has none of that name.
  struct Field {
    std::size_t offset = 0;
    std::uint8_t datatype = 0;
  };
  Result<Field> field(std::string_view name) const;
  double value(const Field& field, std::size_t index) const;

 private:
  PointCloudView() = default;
  Result<std::optional<Field>> find(std::initializer_list<std::string_view> names) const;
  const std::uint8_t* point(std::size_t index) const {
    return data_ + (index / width_) * row_step_ + (index % width_) * point_step_;
  }
  Result<> find_time_scale(PointTimeUnit unit, double stamp);
  template <class T>
  void copy_column(const Field& field, std::vector<T>& out) const;

  const std::vector<sensor_msgs::msg::PointField>* fields_ = nullptr;
  const std::uint8_t* data_ = nullptr;
  std::size_t width_ = 0, height_ = 0, point_step_ = 0, row_step_ = 0;
  bool swap_ = false;
  Field x_, y_, z_;
  std::optional<Field> intensity_, ring_, time_;
  double time_scale_ = 1.0, time_origin_ = 0.0;  // seconds = (value - origin) * scale
};

}  // namespace adit
