// Reads 16-bit thermal pixels from adit_msgs/ThermalFrame or sensor_msgs/Image, whatever row step and byte order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "idl/result.hpp"

namespace adit::adit_msgs::msg {
struct ThermalFrame;
}
namespace adit::sensor_msgs::msg {
struct Image;
}

namespace adit {

// Refers to the message, which must outlive the view unchanged. Copyable, cheap. One message, any number of threads.
class ThermalFrameView {
 public:
  struct Radiometry {
    float scale = 0.0f;   // K per count
    float offset = 0.0f;  // K
  };

  // Refuse a frame whose size, step and data do not fit together, and an image that is not mono16 or 16UC1; the message
  // says what does not fit.
  static Result<ThermalFrameView> of(const adit_msgs::msg::ThermalFrame& frame);
  static Result<ThermalFrameView> of(const sensor_msgs::msg::Image& image);

  std::size_t width() const { return width_; }
  std::size_t height() const { return height_; }
  std::size_t size() const { return width_ * height_; }
  // Largest count the sensor gives: 16383 for 14 bits; 65535 when the message does not say.
  std::uint16_t saturation() const { return saturation_; }
  // Kelvin = scale * count + offset; empty when the frame is not radiometric.
  const std::optional<Radiometry>& radiometry() const { return radiometry_; }

  // Preconditions: row < height(), column < width().
  std::uint16_t at(std::size_t row, std::size_t column) const;
  // The row as it lies in the message, without copying; empty when byte order or alignment forbid it.
  std::span<const std::uint16_t> direct_row(std::size_t row) const;
  // Precondition: out.size() == width().
  void copy_row(std::size_t row, std::span<std::uint16_t> out) const;
  // All pixels, row after row without padding. Precondition: out.size() == size().
  void copy_to(std::span<std::uint16_t> out) const;

 private:
  ThermalFrameView() = default;
  static Result<ThermalFrameView> make(std::uint32_t width, std::uint32_t height, std::uint32_t step, bool bigendian,
                                       std::span<const std::uint8_t> data);

  const std::uint8_t* data_ = nullptr;
  std::size_t width_ = 0, height_ = 0, step_ = 0;
  bool swap_ = false;
  std::uint16_t saturation_ = 65535;
  std::optional<Radiometry> radiometry_;
};

}  // namespace adit
