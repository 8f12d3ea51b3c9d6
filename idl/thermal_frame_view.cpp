#include "idl/thermal_frame_view.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <string>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "sensor_msgs/msg/image.hpp"

namespace adit {
namespace {

constexpr std::uint16_t swapped(std::uint16_t value) {
  return static_cast<std::uint16_t>(value << 8 | value >> 8);
}

Error malformed(std::string text) {
  return {ErrorCode::malformed, "thermal frame: " + std::move(text)};
}

}  // namespace

Result<ThermalFrameView> ThermalFrameView::make(std::uint32_t width, std::uint32_t height, std::uint32_t step,
                                                bool bigendian, std::span<const std::uint8_t> data) {
  if (width == 0 || height == 0)
    return malformed("no pixels: " + std::to_string(width) + " x " + std::to_string(height));
  const std::uint64_t row_bytes = std::uint64_t{width} * 2;
  if (step < row_bytes) {
    return malformed("step " + std::to_string(step) + " is less than 2 bytes times width " + std::to_string(width));
  }
  // The padding behind the last row may be missing.
  const std::uint64_t needed = std::uint64_t{height - 1} * step + row_bytes;
  if (data.size() < needed) {
    return malformed("data holds " + std::to_string(data.size()) + " bytes, " + std::to_string(height) + " rows of " +
                     std::to_string(step) + " bytes need " + std::to_string(needed));
  }
  ThermalFrameView view;
  view.data_ = data.data();
  view.width_ = width;
  view.height_ = height;
  view.step_ = step;
  view.swap_ = bigendian != (std::endian::native == std::endian::big);
  return view;
}

Result<ThermalFrameView> ThermalFrameView::of(const adit_msgs::msg::ThermalFrame& frame) {
  auto view = make(frame.width, frame.height, frame.step, frame.is_bigendian, frame.data.span());
  if (!view) return view;
  if (frame.significant_bits > 16) {
    return malformed("significant_bits " + std::to_string(frame.significant_bits) + ": a pixel has 16");
  }
  if (frame.significant_bits > 0) {
    view->saturation_ = static_cast<std::uint16_t>((1u << frame.significant_bits) - 1);
  }
  if (frame.radiometric_scale != 0.0f) {
    if (!std::isfinite(frame.radiometric_scale) || !std::isfinite(frame.radiometric_offset)) {
      return malformed("radiometric scale and offset are not finite");
    }
    view->radiometry_ = Radiometry{frame.radiometric_scale, frame.radiometric_offset};
  }
  return view;
}

Result<ThermalFrameView> ThermalFrameView::of(const sensor_msgs::msg::Image& image) {
  if (image.encoding != "mono16" && image.encoding != "16UC1") {
    return malformed("encoding '" + image.encoding + "': mono16 or 16UC1 is needed");
  }
  return make(image.width, image.height, image.step, image.is_bigendian != 0, image.data.span());
}

std::uint16_t ThermalFrameView::at(std::size_t row, std::size_t column) const {
  std::uint16_t value;
  std::memcpy(&value, data_ + row * step_ + 2 * column, sizeof value);
  return swap_ ? swapped(value) : value;
}

std::span<const std::uint16_t> ThermalFrameView::direct_row(std::size_t row) const {
  const std::uint8_t* const from = data_ + row * step_;
  if (swap_ || reinterpret_cast<std::uintptr_t>(from) % alignof(std::uint16_t) != 0) return {};
  return {reinterpret_cast<const std::uint16_t*>(from), width_};
}

void ThermalFrameView::copy_row(std::size_t row, std::span<std::uint16_t> out) const {
  std::memcpy(out.data(), data_ + row * step_, 2 * width_);
  if (!swap_) return;
  for (std::uint16_t& value : out.first(width_)) value = swapped(value);
}

void ThermalFrameView::copy_to(std::span<std::uint16_t> out) const {
  for (std::size_t row = 0; row < height_; ++row) copy_row(row, out.subspan(row * width_, width_));
}

}  // namespace adit
