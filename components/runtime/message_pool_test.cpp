#include "components/runtime/message_pool.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "sensor_msgs/msg/image.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::Image;

int held = 0;
constexpr KeepAliveOperations counting = {[](void*) noexcept { ++held; }, [](void*) noexcept { --held; }};

TEST(MessagePool, HandsOutTheSameMessagesAgainWithTheMemoryTheyHaveGrown) {
  MessagePool pool(erased_type<Image>(), 1);
  std::shared_ptr<void> first = pool.acquire();
  auto* const image = static_cast<Image*>(first.get());
  image->data.resize(1000);
  const std::uint8_t* const memory = image->data.data();
  first.reset();
  const std::shared_ptr<void> second = pool.acquire();
  EXPECT_EQ(second.get(), image);
  EXPECT_EQ(image->data.data(), memory);
  EXPECT_EQ(pool.misses(), 0u);
}

TEST(MessagePool, BuildsMoreWhenAllAreOutAndCountsThem) {
  MessagePool pool(erased_type<Image>(), 2);
  std::vector<std::shared_ptr<void>> out;
  for (int i = 0; i < 5; ++i) out.push_back(pool.acquire());
  EXPECT_EQ(pool.misses(), 3u);
  out.clear();
  for (int i = 0; i < 2; ++i) out.push_back(pool.acquire());
  EXPECT_EQ(pool.misses(), 3u);
}

TEST(MessagePool, LetsReceivedSamplesGoWhenAMessageComesBack) {
  MessagePool pool(erased_type<Image>(), 1);
  const std::uint8_t bytes[4] = {};
  std::shared_ptr<void> message = pool.acquire();
  held = 1;
  static_cast<Image*>(message.get())->data = Blob::view(bytes, KeepAlive(&counting, nullptr));
  EXPECT_EQ(held, 1);
  message.reset();
  EXPECT_EQ(held, 0);
}

TEST(MessagePool, ItsMessagesMayOutliveIt) {
  std::shared_ptr<void> message;
  {
    MessagePool pool(erased_type<Image>(), 2);
    message = pool.acquire();
  }
  static_cast<Image*>(message.get())->data.resize(10);
  message.reset();
}

}  // namespace
}  // namespace adit
