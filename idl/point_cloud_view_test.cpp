#include "idl/point_cloud_view.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "idl/point_cloud_writer.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;
using ::testing::ElementsAre;
using ::testing::FloatEq;
using ::testing::HasSubstr;

const float nan = std::numeric_limits<float>::quiet_NaN();

// Writes values field by field, so that a test states a layout in a line.
class CloudMaker {
 public:
  CloudMaker(std::uint32_t width, std::uint32_t height, std::uint32_t point_step, std::uint32_t row_padding = 0,
             bool bigendian = false) {
    cloud.width = width;
    cloud.height = height;
    cloud.point_step = point_step;
    cloud.row_step = width * point_step + row_padding;
    cloud.is_bigendian = bigendian;
    cloud.data.resize(height * cloud.row_step);
    std::memset(cloud.data.mutable_data(), 0xee, cloud.data.size());
  }
  template <class T>
  CloudMaker& field(const char* name, std::uint32_t offset, std::uint8_t datatype, std::vector<T> values) {
    PointField field;
    field.name = name;
    field.offset = offset;
    field.datatype = datatype;
    field.count = 1;
    cloud.fields.push_back(field);
    for (std::size_t i = 0; i < values.size(); ++i) {
      std::uint8_t bytes[sizeof(T)];
      std::memcpy(bytes, &values[i], sizeof(T));
      if (cloud.is_bigendian) std::reverse(std::begin(bytes), std::end(bytes));
      const std::size_t at = i / cloud.width * cloud.row_step + i % cloud.width * cloud.point_step + offset;
      std::memcpy(cloud.data.mutable_data() + at, bytes, sizeof(T));
    }
    return *this;
  }
  PointCloud2 cloud;
};

CloudMaker two_points(std::uint32_t step = 32, bool bigendian = false) {
  CloudMaker maker(2, 1, step, 0, bigendian);
  maker.field<float>("x", 0, PointField::FLOAT32, {1.0f, 4.0f});
  maker.field<float>("y", 4, PointField::FLOAT32, {2.0f, 5.0f});
  maker.field<float>("z", 8, PointField::FLOAT32, {3.0f, 6.0f});
  return maker;
}

PointColumns columns_of(const PointCloud2& cloud, NonFinitePoints non_finite = NonFinitePoints::drop) {
  PointColumns columns;
  const auto view = PointCloudView::of(cloud);
  EXPECT_TRUE(view) << view.error().message;
  if (view) view->copy_to(columns, non_finite);
  return columns;
}

TEST(PointCloudView, BothEndiannessesGiveTheSamePoints) {
  for (const bool bigendian : {false, true}) {
    CloudMaker maker = two_points(32, bigendian);
    maker.field<std::uint16_t>("ring", 12, PointField::UINT16, {7, 300});
    maker.field<double>("intensity", 16, PointField::FLOAT64, {0.5, 250.0});
    const PointColumns columns = columns_of(maker.cloud);
    EXPECT_THAT(columns.x, ElementsAre(1.0f, 4.0f));
    EXPECT_THAT(columns.y, ElementsAre(2.0f, 5.0f));
    EXPECT_THAT(columns.z, ElementsAre(3.0f, 6.0f));
    EXPECT_THAT(columns.ring, ElementsAre(7, 300));
    EXPECT_THAT(columns.intensity, ElementsAre(0.5f, 250.0f));
    EXPECT_TRUE(columns.time.empty());
    const auto view = PointCloudView::of(maker.cloud);
    EXPECT_THAT(view->position(1), ElementsAre(4.0f, 5.0f, 6.0f));
    EXPECT_EQ(view->ring(1), 300);
  }
}

TEST(PointCloudView, EveryDatatypeIsRead) {
  CloudMaker maker(1, 1, 64);
  maker.field<std::int8_t>("x", 0, PointField::INT8, {-5});
  maker.field<std::int16_t>("y", 1, PointField::INT16, {-300});
  maker.field<std::int32_t>("z", 3, PointField::INT32, {-70000});
  maker.field<std::uint8_t>("reflectivity", 7, PointField::UINT8, {200});
  maker.field<std::uint8_t>("line", 8, PointField::UINT8, {3});
  maker.field<std::uint32_t>("range", 9, PointField::UINT32, {4000000000u});
  const auto view = PointCloudView::of(maker.cloud);
  ASSERT_TRUE(view);
  EXPECT_THAT(view->position(0), ElementsAre(-5.0f, -300.0f, -70000.0f));
  EXPECT_EQ(view->intensity(0), 200.0f);
  EXPECT_EQ(view->ring(0), 3);
  EXPECT_EQ(view->value(*view->field("range"), 0), 4000000000.0);
  EXPECT_EQ(view->field("nothing").error().code, ErrorCode::not_found);
}

TEST(PointCloudView, RowsWithPaddingAreOrganized) {
  CloudMaker maker(2, 2, 12, 5);
  maker.field<float>("x", 0, PointField::FLOAT32, {1, 2, 3, 4});
  maker.field<float>("y", 4, PointField::FLOAT32, {0, 0, 0, 0});
  maker.field<float>("z", 8, PointField::FLOAT32, {0, 0, 0, 0});
  maker.cloud.data.resize(maker.cloud.data.size() - 5);  // no padding behind the last row
  EXPECT_THAT(columns_of(maker.cloud).x, ElementsAre(1, 2, 3, 4));
}

TEST(PointCloudView, TimeRules) {
  const auto times = [](const char* name, auto first, auto second, std::uint8_t datatype,
                        PointTimeUnit unit = PointTimeUnit::automatic) {
    CloudMaker maker = two_points();
    maker.cloud.header.stamp.sec = 1700000000;
    maker.cloud.header.stamp.nanosec = 250000000;
    maker.field<decltype(first)>(name, 16, datatype, {first, second});
    PointColumns columns;
    PointCloudView::of(maker.cloud, unit)->copy_to(columns);
    return columns.time;
  };
  const auto near = [](double a, double b, double tolerance = 1e-6) {
    return ElementsAre(testing::DoubleNear(a, tolerance), testing::DoubleNear(b, tolerance));
  };
  EXPECT_THAT(times("t", std::uint32_t{1000}, std::uint32_t{99000000}, PointField::UINT32), near(1e-6, 0.099));
  EXPECT_THAT(times("offset_time", std::uint32_t{0}, std::uint32_t{5}, PointField::UINT32), near(0.0, 5e-9, 1e-12));
  EXPECT_THAT(times("time", -0.1f, 0.0f, PointField::FLOAT32), near(-0.1, 0.0));
  EXPECT_THAT(times("timestamp", 1700000000.25, 1700000000.35, PointField::FLOAT64), near(0.0, 0.1));
  EXPECT_THAT(times("timestamp", 1.70000000025e18, 1.70000000035e18, PointField::FLOAT64), near(0.0, 0.1));
  EXPECT_THAT(times("timestamp", 1.70000000025e15, 1.70000000035e15, PointField::FLOAT64), near(0.0, 0.1));
  EXPECT_THAT(times("time", 0.0f, 99.0f, PointField::FLOAT32, PointTimeUnit::milliseconds), near(0.0, 0.099));
}

TEST(PointCloudView, SimulatedClockSecondsAreAbsolute) {
  CloudMaker maker = two_points();
  maker.cloud.header.stamp.sec = 100;
  maker.field<double>("timestamp", 16, PointField::FLOAT64, {100.0, 100.1});
  EXPECT_NEAR(columns_of(maker.cloud).time[1], 0.1, 1e-9);
}

TEST(PointCloudView, TimesOfUnknownMeaningAreRefused) {
  CloudMaker maker = two_points();
  maker.cloud.header.stamp.sec = 1700000000;
  maker.field<float>("time", 16, PointField::FLOAT32, {0.0f, 99.0f});  // ms? s of another clock?
  const auto view = PointCloudView::of(maker.cloud);
  ASSERT_FALSE(view);
  EXPECT_THAT(view.error().message, HasSubstr("name their unit"));
  EXPECT_TRUE(PointCloudView::of(maker.cloud, PointTimeUnit::milliseconds));
  const auto without = PointCloudView::of(maker.cloud, PointTimeUnit::unused);
  ASSERT_TRUE(without);
  EXPECT_FALSE(without->has_time());
}

TEST(PointCloudView, AbsoluteTimeInFloat32IsTooCoarse) {
  CloudMaker maker = two_points();
  maker.cloud.header.stamp.sec = 1700000000;
  maker.field<float>("timestamp", 16, PointField::FLOAT32, {1.7e9f, 1.7e9f});
  EXPECT_FALSE(PointCloudView::of(maker.cloud));
}

TEST(PointCloudView, NonFinitePointsAreDroppedOrKept) {
  CloudMaker maker(3, 1, 16);
  maker.field<float>("x", 0, PointField::FLOAT32, {nan, 2.0f, 3.0f});
  maker.field<float>("y", 4, PointField::FLOAT32, {0.0f, 0.0f, 1.0f / 0.0f});
  maker.field<float>("z", 8, PointField::FLOAT32, {0.0f, 0.0f, 0.0f});
  maker.field<float>("intensity", 12, PointField::FLOAT32, {1.0f, 2.0f, 3.0f});
  const PointColumns kept = columns_of(maker.cloud);
  EXPECT_THAT(kept.x, ElementsAre(2.0f));
  EXPECT_THAT(kept.intensity, ElementsAre(2.0f));
  EXPECT_THAT(kept.index, ElementsAre(1));
  EXPECT_EQ(columns_of(maker.cloud, NonFinitePoints::keep).x.size(), 3);
}

TEST(PointCloudView, RefusesWhatDoesNotFit) {
  const auto reason = [](auto change) {
    CloudMaker maker = two_points(16);
    change(maker.cloud);
    const auto view = PointCloudView::of(maker.cloud);
    EXPECT_FALSE(view);
    return view ? std::string() : view.error().message;
  };
  EXPECT_THAT(reason([](PointCloud2& c) { c.fields.erase(c.fields.begin()); }), HasSubstr("no field x"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.fields[1].offset = 13; }), HasSubstr("beyond point_step"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.fields[1].offset = 0xffffffff; }), HasSubstr("beyond point_step"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.fields[1].datatype = 9; }), HasSubstr("unknown datatype 9"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.data.resize(31); }), HasSubstr("31 bytes"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.width = 0xffffffff; }), HasSubstr("need"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.height = 2, c.row_step = 20; }), HasSubstr("row_step 20"));
  EXPECT_THAT(reason([](PointCloud2& c) { c.height = 0xffffffff; }), HasSubstr("need"));
}

TEST(PointCloudView, EmptyCloudIsFine) {
  CloudMaker maker = two_points();
  maker.cloud.width = 0;
  maker.cloud.height = 0xffffffff;  // found by fuzzing: rows of no points took seconds
  maker.cloud.data.clear();
  const auto view = PointCloudView::of(maker.cloud);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->size(), 0u);
  EXPECT_EQ(view->height(), 0u);
  EXPECT_TRUE(columns_of(maker.cloud).x.empty());
}

TEST(PointCloudView, SecondCopyDoesNotMoveMemory) {
  const CloudMaker maker = two_points();
  PointColumns columns;
  PointCloudView::of(maker.cloud)->copy_to(columns);
  const float* const before = columns.x.data();
  PointCloudView::of(maker.cloud)->copy_to(columns);
  EXPECT_EQ(columns.x.data(), before);
}

TEST(WritePoints, EveryLayoutReadsBack) {
  const std::vector<LidarPoint> points = {{1.0f, 2.0f, 3.0f, 40.0f, 0.05, 9}, {-1.0f, 0.0f, 0.5f, 7.0f, 0.1, 15}};
  for (const PointLayout layout : {PointLayout::xyzi, PointLayout::velodyne, PointLayout::ouster}) {
    PointCloud2 cloud;
    ASSERT_TRUE(write_points(points, 2, layout, cloud));
    EXPECT_EQ(cloud.height, 2u);
    EXPECT_TRUE(cloud.is_dense);
    const PointColumns columns = columns_of(cloud);
    EXPECT_THAT(columns.x, ElementsAre(1.0f, -1.0f));
    EXPECT_THAT(columns.z, ElementsAre(3.0f, 0.5f));
    EXPECT_THAT(columns.intensity, ElementsAre(40.0f, 7.0f));
    if (layout == PointLayout::xyzi) continue;
    EXPECT_THAT(columns.ring, ElementsAre(9, 15));
    EXPECT_THAT(columns.time, ElementsAre(testing::DoubleNear(0.05, 1e-8), testing::DoubleNear(0.1, 1e-8)));
  }
}

TEST(WritePoints, RowsMustBeEqual) {
  PointCloud2 cloud;
  EXPECT_FALSE(write_points(std::vector<LidarPoint>(3), 2, PointLayout::xyzi, cloud));
  EXPECT_FALSE(write_points(std::vector<LidarPoint>(3), 0, PointLayout::xyzi, cloud));
}

}  // namespace
}  // namespace adit
