#include "idl/thermal_frame_view.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <vector>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "sensor_msgs/msg/image.hpp"

namespace adit {
namespace {

using adit_msgs::msg::ThermalFrame;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// 2 x 2 pixels 0x0102 0x0304 / 0x0506 0x0708 with `step` bytes a row.
ThermalFrame frame_of(std::uint32_t step, bool bigendian) {
  ThermalFrame frame;
  frame.width = 2;
  frame.height = 2;
  frame.step = step;
  frame.is_bigendian = bigendian;
  frame.significant_bits = 14;
  frame.data.resize(2 * step);
  for (std::uint32_t row = 0; row < 2; ++row) {
    for (std::uint32_t column = 0; column < 2; ++column) {
      std::uint8_t* const at = frame.data.mutable_data() + row * step + 2 * column;
      const auto high = static_cast<std::uint8_t>(1 + 4 * row + 2 * column);
      at[bigendian ? 0 : 1] = high;
      at[bigendian ? 1 : 0] = static_cast<std::uint8_t>(high + 1);
    }
  }
  return frame;
}

TEST(ThermalFrameView, ReadsEitherEndiannessAndAnyStep) {
  for (const bool bigendian : {false, true}) {
    for (const std::uint32_t step : {4u, 5u, 16u}) {
      const ThermalFrame frame = frame_of(step, bigendian);
      const auto view = ThermalFrameView::of(frame);
      ASSERT_TRUE(view);
      std::vector<std::uint16_t> pixels(view->size());
      view->copy_to(pixels);
      EXPECT_THAT(pixels, ElementsAre(0x0102, 0x0304, 0x0506, 0x0708));
      EXPECT_EQ(view->at(1, 0), 0x0506);
      EXPECT_EQ(view->saturation(), 16383);
      EXPECT_EQ(view->direct_row(0).empty(), bigendian);
      EXPECT_FALSE(view->radiometry());
    }
  }
}

TEST(ThermalFrameView, Radiometry) {
  ThermalFrame frame = frame_of(4, false);
  frame.radiometric_scale = 0.01f;
  frame.radiometric_offset = -5.0f;
  const auto view = ThermalFrameView::of(frame);
  ASSERT_TRUE(view && view->radiometry());
  EXPECT_EQ(view->radiometry()->scale, 0.01f);
  frame.radiometric_scale = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(ThermalFrameView::of(frame));
}

TEST(ThermalFrameView, ReadsMono16Images) {
  const ThermalFrame frame = frame_of(6, true);
  sensor_msgs::msg::Image image;
  image.width = frame.width;
  image.height = frame.height;
  image.step = frame.step;
  image.is_bigendian = 1;
  image.data = frame.data;
  for (const char* encoding : {"mono16", "16UC1"}) {
    image.encoding = encoding;
    const auto view = ThermalFrameView::of(image);
    ASSERT_TRUE(view);
    EXPECT_EQ(view->at(0, 1), 0x0304);
    EXPECT_EQ(view->saturation(), 65535);
  }
  image.encoding = "mono8";
  EXPECT_THAT(ThermalFrameView::of(image).error().message, HasSubstr("'mono8'"));
}

TEST(ThermalFrameView, RefusesWhatDoesNotFit) {
  const auto reason = [](auto change) {
    ThermalFrame frame = frame_of(4, false);
    change(frame);
    const auto view = ThermalFrameView::of(frame);
    EXPECT_FALSE(view);
    return view ? std::string() : view.error().message;
  };
  EXPECT_THAT(reason([](ThermalFrame& f) { f.width = 0; }), HasSubstr("no pixels"));
  EXPECT_THAT(reason([](ThermalFrame& f) { f.step = 3; }), HasSubstr("step 3"));
  EXPECT_THAT(reason([](ThermalFrame& f) { f.height = 3; }), HasSubstr("need 12"));
  EXPECT_THAT(reason([](ThermalFrame& f) { f.width = 0xffffffff, f.step = 0xffffffff; }), HasSubstr("step"));
  EXPECT_THAT(reason([](ThermalFrame& f) { f.height = 0xffffffff, f.step = 0xffffffff; }), HasSubstr("need"));
  EXPECT_THAT(reason([](ThermalFrame& f) { f.significant_bits = 17; }), HasSubstr("significant_bits"));
}

}  // namespace
}  // namespace adit
