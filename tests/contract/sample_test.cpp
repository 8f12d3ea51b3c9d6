// Samples as memory: they live as long as they are held, on any thread, and taking them neither blocks nor allocates.
#include <dlfcn.h>
#include <execinfo.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <thread>

#include "idl/testing/allocation_counter.hpp"
#include "tests/contract/contract.hpp"

namespace {

// Allocations of the calling thread while observed: by a vendor's library, and by everybody else (us).
std::size_t by_vendor = 0, by_us = 0;
std::array<const void*, 8> our_callers{};

const char* object_of(const void* address) {
  Dl_info object{};
  return dladdr(address, &object) != 0 && object.dli_fname ? object.dli_fname : "?";
}

bool allocates_for_others(const void* frame) {
  const char* const object = object_of(frame);
  constexpr std::array libraries = {"libstdc++", "libc.so", "libasan", "libtsan"};
  return std::any_of(libraries.begin(), libraries.end(), [&](const char* name) { return std::strstr(object, name); });
}

// The standard libraries and the sanitizers' allocators allocate on behalf of whoever called them.
const void* who_asked(const void* caller) {
  if (!allocates_for_others(caller)) return caller;
  std::array<void*, 32> frames{};
  const auto end = frames.begin() + backtrace(frames.data(), static_cast<int>(frames.size()));
  const auto asked = std::find_if_not(std::find(frames.begin(), end, caller), end, allocates_for_others);
  return asked == end ? caller : *asked;
}

void count(const void* caller) {
  caller = who_asked(caller);
  const char* const object = object_of(caller);
  if (std::strstr(object, "libfast") || std::strstr(object, "libddsc")) {
    ++by_vendor;
  } else {
    our_callers[by_us++ % our_callers.size()] = caller;
  }
}

class Observed {
 public:
  Observed() { adit::test::observe_allocations_of_this_thread(&count); }
  ~Observed() { adit::test::observe_allocations_of_this_thread(nullptr); }
};

// Which functions those were that count as ours.
std::string names_of_our_callers() {
  std::string names;
  for (std::size_t i = 0; i < std::min(by_us, our_callers.size()); ++i) {
    Dl_info object{};
    if (dladdr(our_callers[i], &object) == 0) continue;
    names += std::string("\n  ") + object_of(our_callers[i]) + ": " + (object.dli_sname ? object.dli_sname : "?");
  }
  return names;
}

}  // namespace

namespace adit::contract {
namespace {

class Samples : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Samples, testing::ValuesIn(all_pairs()), name_of);

TEST_P(Samples, OutliveTheNextTakesTheReaderAndTheParticipants) {
  std::vector<Sample> kept;
  {
    Link link(*this, GetParam(), Qos::reliable(100), Qos::reliable(100));
    ASSERT_TRUE(link.reader && link.writer);
    Collector collector(*link.reader);
    for (unsigned n = 1; n <= 20; ++n) {
      ASSERT_TRUE(link.writer->publish(Payload(70000, n)));
      ASSERT_TRUE(collector.wait_for(n));
    }
    kept = std::move(collector.samples);
    for (unsigned n = 1; n <= 20; ++n) EXPECT_TRUE(is_intact(kept[n - 1].bytes(), 70000)) << n;
    kept.resize(10);
  }
  std::thread([&] {
    for (unsigned n = 1; n <= 10; ++n) {
      EXPECT_EQ(number_in(kept[n - 1].bytes()), n);
      EXPECT_TRUE(is_intact(kept[n - 1].bytes(), 70000)) << n;
    }
    kept.clear();
  }).join();
}

TEST_P(Samples, CanBeHeldUpToTheReadersDepth) {
  constexpr unsigned depth = 10;
  Link link(*this, GetParam(), Qos::reliable(depth), Qos::reliable(depth));
  ASSERT_TRUE(link.reader && link.writer);
  std::vector<Sample> held;
  {
    Collector collector(*link.reader);
    for (unsigned n = 1; n <= depth; ++n) {
      ASSERT_TRUE(link.writer->publish(Payload(200000, n)));
      ASSERT_TRUE(collector.wait_for(n)) << n;
    }
    held = std::move(collector.samples);
  }
  for (unsigned n = 1; n <= depth; ++n) EXPECT_TRUE(is_intact(held[n - 1].bytes(), 200000)) << n;
  held.clear();
  Collector collector(*link.reader);
  for (unsigned n = 1; n <= depth; ++n) {
    ASSERT_TRUE(link.writer->publish(Payload(200000, 100 + n)));
    ASSERT_TRUE(collector.wait_for(n)) << "after the held ones were given back: " << n;
  }
}

TEST_P(Samples, KeepAliveHoldsTheBytesWithoutTheSample) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  Collector collector(*link.reader);
  ASSERT_TRUE(link.writer->publish(Payload(100000, 9)));
  ASSERT_TRUE(collector.wait_for(1));
  const Bytes bytes = collector.samples[0].bytes();
  KeepAlive memory = collector.samples[0].memory();
  KeepAlive second = memory;
  collector.samples.clear();
  memory = {};
  for (unsigned n = 1; n <= 20; ++n) {
    ASSERT_TRUE(link.writer->publish(Payload(100000, 100 + n)));
    ASSERT_TRUE(collector.wait_for(1));
    collector.samples.clear();
  }
  EXPECT_TRUE(is_intact(bytes, 100000));
  EXPECT_EQ(number_in(bytes), 9u);
}

TEST_P(Samples, TakeOfNothingReturnsAtOnce) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  Sample sample[4];
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(link.reader->take(sample), 0u);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 1s);
  EXPECT_EQ(link.reader->take({}), 0u);
}

TEST_P(Samples, NotificationFollowsItsRules) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  std::atomic<int> first = 0;
  std::atomic<int> second = 0;
  link.reader->on_data([&] { ++first; });
  ASSERT_TRUE(link.writer->publish(Payload(64, 1)));
  ASSERT_TRUE(wait_until([&] { return first > 0; }));
  const int before = first;
  link.reader->on_data([&] { ++second; });
  EXPECT_GT(second, 0) << "a sample is waiting: the new one is called at once";
  ASSERT_TRUE(link.writer->publish(Payload(64, 2)));
  Sample samples[2];
  std::size_t taken = 0;
  ASSERT_TRUE(wait_until([&] { return (taken += link.reader->take(samples)) == 2; }));
  EXPECT_EQ(first, before);
  link.reader->on_data(nullptr);
  const int after = second;
  ASSERT_TRUE(link.writer->publish(Payload(64, 3)));
  ASSERT_TRUE(wait_until([&] { return link.reader->take(samples) == 1; }));
  EXPECT_EQ(second, after);
}

// What a vendor allocates itself is reported, not judged: Fast DDS does with each sample.
TEST_P(Samples, PublishAndTakeDoNotAllocateOnceWarm) {
  for (const std::size_t size : {std::size_t{1024}, std::size_t{1} << 20}) {
    Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
    ASSERT_TRUE(link.reader && link.writer);
    // Warm: as many samples in flight as there can ever be, which a latched writer holds whatever readers do.
    constexpr unsigned depth = 10;
    {
      const auto latched = make_writer(*link.writer_side, endpoint("warm", Qos::latched(3 * depth)));
      ASSERT_TRUE(latched);
      for (unsigned n = 1; n <= 3 * depth; ++n) ASSERT_TRUE(latched->publish(Payload(size, n)));
    }
    for (unsigned round = 0; round < 3; ++round) {
      Collector collector(*link.reader);
      for (unsigned n = 1; n <= depth; ++n) ASSERT_TRUE(link.writer->publish(Payload(size, n)));
      ASSERT_TRUE(collector.wait_for(depth));
    }
    by_us = by_vendor = 0;
    constexpr unsigned measured = 50;
    for (unsigned n = 1; n <= measured; ++n) {
      const Payload message(size, n);
      bool sent = false;
      {
        const Observed observed;
        sent = static_cast<bool>(link.writer->publish(message));
      }
      ASSERT_TRUE(sent);
      Sample sample[1];
      std::size_t taken = 0;
      ASSERT_TRUE(wait_until([&] {
        const Observed observed;
        taken = link.reader->take(sample);
        return taken == 1;
      }));
      const Observed observed;
      sample[0].reset();
    }
    std::printf("%zu bytes: allocations per message in our calls: ours %.2f, the vendors' %.2f\n", size,
                static_cast<double>(by_us) / measured, static_cast<double>(by_vendor) / measured);
    EXPECT_EQ(by_us, 0u) << measured << " messages of " << size << " bytes" << names_of_our_callers();
  }
}

}  // namespace
}  // namespace adit::contract
