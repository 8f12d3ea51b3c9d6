// The data path does not touch the heap: counted by replacing malloc (this program's own).
#include <gtest/gtest.h>

#include <atomic>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/fake_participant.hpp"
#include "components/runtime/testing/harness.hpp"
#include "idl/testing/allocation_counter.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;
using test::allocations_of_this_thread;
using testing::eventually;
using testing::FakeDomain;
using testing::Harness;

constexpr int warm_up = 50;
constexpr int measured = 200;

struct Source final : Component {
  Output<PointCloud2> cloud{*this, "cloud", Qos::sensor()};
  std::atomic<int> ticks{0};
  std::atomic<std::uint64_t> at_start{0}, at_end{0};
  Timer timer{*this, "tick", std::chrono::milliseconds(1), [this] {
                if (ticks == warm_up) at_start = allocations_of_this_thread();
                Loan<PointCloud2> loan = cloud.loan();
                loan->header.frame_id = "lidar_frame_with_a_long_name";
                loan->fields.resize(4);
                for (PointField& field : loan->fields) field.name = "x";
                loan->data.resize(100'000);
                cloud.publish(std::move(loan));
                if (++ticks == warm_up + measured) at_end = allocations_of_this_thread();
              }};
};

struct Sink final : Component {
  std::atomic<int> handled{0};
  std::atomic<std::uint64_t> at_start{0}, at_end{0};
  std::atomic<bool> views{true};
  std::shared_ptr<const PointCloud2> last;  // as a component does that keeps the previous cloud
  bool expect_view = true;
  Input<PointCloud2> cloud{*this, "cloud", Qos::sensor(), Queue{4, WhenFull::drop_oldest},
                           [this](std::shared_ptr<const PointCloud2> message, const MessageInfo&) {
                             if (message->data.is_view() != expect_view) views = false;
                             last = std::move(message);
                             ++handled;
                             if (handled == warm_up) at_start = allocations_of_this_thread();
                             if (handled == warm_up + measured) at_end = allocations_of_this_thread();
                           }};
};

TEST(Allocations, ThereAreNoneFromOutputToInputInOneProcess) {
  Harness harness(1);
  auto& source = harness.make<Source>("source");
  auto& sink = harness.make<Sink>("sink");
  sink.expect_view = false;
  harness.start();
  ASSERT_TRUE(eventually([&] { return sink.at_end != 0 && source.at_end != 0; }));
  EXPECT_EQ(source.at_end - source.at_start, 0u);
  EXPECT_EQ(sink.at_end - sink.at_start, 0u);
  EXPECT_EQ(source.cloud.stats().pool_misses, 0u);
}

TEST(Allocations, ThereAreNoneInTheReceivingExecutorAndTheBlobIsNotCopied) {
  FakeDomain domain;
  Harness sender(1, domain.join()), receiver(1, domain.join());
  sender.make<Source>("source");
  auto& sink = receiver.make<Sink>("sink");
  receiver.start();
  sender.start();
  ASSERT_TRUE(eventually([&] { return sink.at_end != 0; }));
  EXPECT_EQ(sink.at_end - sink.at_start, 0u);
  EXPECT_TRUE(sink.views);
  EXPECT_EQ(sink.cloud.stats().pool_misses, 0u);
}

TEST(Allocations, TheCounterCounts) {
  const std::uint64_t before = allocations_of_this_thread();
  const std::string text(100, 'x');
  EXPECT_EQ(allocations_of_this_thread() - before, 1u);
}

}  // namespace
}  // namespace adit
