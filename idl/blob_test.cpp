#include "idl/blob.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace adit {
namespace {

struct Counted {
  int references = 1;
  static constexpr KeepAliveOperations operations = {
      [](void* handle) noexcept { ++static_cast<Counted*>(handle)->references; },
      [](void* handle) noexcept { --static_cast<Counted*>(handle)->references; }};
  KeepAlive keep_alive() { return {&operations, this}; }
};

TEST(Blob, OwnsAndCopies) {
  Blob a{1, 2, 3};
  const Blob b = a;
  a.mutable_data()[0] = 9;
  EXPECT_EQ(b, (Blob{1, 2, 3}));
  EXPECT_EQ(a, (Blob{9, 2, 3}));
  EXPECT_FALSE(a.is_view());
}

TEST(Blob, ResizeKeepsThePrefixAndTheMemory) {
  Blob blob{1, 2, 3, 4};
  const std::uint8_t* const before = blob.data();
  blob.resize(2);
  blob.resize(4);
  EXPECT_EQ(blob.data(), before);
  blob.resize(100);
  EXPECT_EQ(blob[1], 2);
}

TEST(Blob, ViewSharesUntilWritten) {
  Counted sample;
  std::uint8_t bytes[] = {5, 6, 7};
  {
    Blob view = Blob::view(bytes, sample.keep_alive());
    const Blob copy = view;
    EXPECT_EQ(copy.data(), bytes);
    EXPECT_EQ(sample.references, 2);
    view.mutable_data()[0] = 1;
    EXPECT_EQ(bytes[0], 5);
    EXPECT_EQ(view, (Blob{1, 6, 7}));
    EXPECT_EQ(sample.references, 1);
  }
  EXPECT_EQ(sample.references, 0);
}

TEST(Blob, MoveAndClearLetTheSampleGo) {
  Counted sample;
  std::uint8_t bytes[] = {5, 6, 7};
  Blob view = Blob::view(bytes, sample.keep_alive());
  Blob moved = std::move(view);
  EXPECT_EQ(sample.references, 1);
  EXPECT_EQ(moved.size(), 3u);
  moved.clear();
  EXPECT_EQ(sample.references, 0);
  EXPECT_TRUE(moved.empty());
}

TEST(Blob, ViewTakesOverOwnedMemoryAndGivesItBack) {
  Counted sample;
  std::uint8_t bytes[] = {5, 6, 7};
  Blob blob{1, 2, 3, 4};
  blob = Blob::view(bytes, sample.keep_alive());
  EXPECT_EQ(blob.data(), bytes);
  blob.assign(std::span<const std::uint8_t>(bytes));
  EXPECT_EQ(sample.references, 0);
  EXPECT_EQ(blob, (Blob{5, 6, 7}));
}

}  // namespace
}  // namespace adit
