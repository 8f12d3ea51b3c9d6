#include "middleware/fault/fault_line.hpp"

#include <gmock/gmock.h>

#include <cstring>

namespace adit::fault {
namespace {

using testing::ElementsAre;

Sample numbered(std::uint32_t number, std::size_t size = 64) {
  std::vector<std::byte> bytes(size);
  bytes[1] = std::byte{1};
  std::memcpy(bytes.data() + 4, &number, 4);
  MessageInfo info;
  info.sequence = number;
  return make_sample(bytes, info);
}

// Feeds samples 1 to `count` and keeps what comes out.
class FaultLineTest : public testing::Test {
 protected:
  void run(std::vector<FaultRule> rules, std::uint32_t count, std::uint64_t seed = 7) {
    out_.clear();
    line_ = std::make_shared<FaultLine>(std::move(rules), seed, std::chrono::steady_clock::now(), delays_,
                                        [this](Sample sample) {
                                          const std::lock_guard lock(mutex_);
                                          out_.push_back(std::move(sample));
                                          came_.notify_all();
                                        });
    for (std::uint32_t number = 1; number <= count; ++number) line_->process(numbered(number));
  }
  bool wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    return came_.wait_for(lock, std::chrono::seconds(10), [&] { return out_.size() >= count; });
  }
  std::vector<std::uint64_t> numbers() {
    const std::lock_guard lock(mutex_);
    std::vector<std::uint64_t> all;
    for (const auto& sample : out_) all.push_back(sample.info().sequence);
    return all;
  }
  ~FaultLineTest() override {
    if (line_) line_->close();
  }

  std::shared_ptr<DelayThread> delays_ = std::make_shared<DelayThread>();
  std::shared_ptr<FaultLine> line_;
  std::mutex mutex_;
  std::condition_variable came_;
  std::vector<Sample> out_;
};

TEST_F(FaultLineTest, WithoutFaultsEverySamplePassesUntouchedAndAtOnce) {
  run({FaultRule{}}, 3);
  EXPECT_THAT(numbers(), ElementsAre(1, 2, 3));
  EXPECT_EQ(line_->counters(), FaultCounters{.samples = 3});
}

TEST_F(FaultLineTest, EveryNthSampleIsDropped) {
  run({{.drop_every = 3}}, 7);
  EXPECT_THAT(numbers(), ElementsAre(1, 2, 4, 5, 7));
  EXPECT_EQ(line_->counters().dropped, 2u);
}

TEST_F(FaultLineTest, DropsAboutAsOftenAsAskedAndTheSameForTheSameSeed) {
  run({{.drop = 0.25}}, 4000);
  const auto first = numbers();
  EXPECT_EQ(line_->counters().dropped + first.size(), 4000u);
  EXPECT_NEAR(static_cast<double>(first.size()), 3000.0, 120.0);  // more than 4 sigma
  run({{.drop = 0.25}}, 4000);
  EXPECT_EQ(numbers(), first);
  run({{.drop = 0.25}}, 4000, 8);
  EXPECT_NE(numbers(), first);
}

TEST_F(FaultLineTest, AnotherFaultDoesNotChangeWhichSamplesAreDropped) {
  run({{.drop = 0.5}}, 200);
  const auto dropped_alone = numbers();
  run({{.drop = 0.5, .corrupt = 0.5}}, 200);
  EXPECT_EQ(numbers(), dropped_alone);
}

TEST_F(FaultLineTest, CorruptionFlipsTheGivenNumberOfBitsBehindTheHeader) {
  run({{.corrupt = 1.0, .corrupt_bits = 1}}, 50);
  ASSERT_EQ(out_.size(), 50u);
  for (std::uint32_t i = 0; i < 50; ++i) {
    const Sample original = numbered(i + 1);
    int flipped = 0;
    for (std::size_t byte = 0; byte < 64; ++byte) {
      const auto difference = std::to_integer<unsigned>(original.bytes()[byte] ^ out_[i].bytes()[byte]);
      if (byte < 4) {
        EXPECT_EQ(difference, 0u);
      }
      flipped += std::popcount(difference);
    }
    EXPECT_EQ(flipped, 1);
  }
  EXPECT_EQ(line_->counters().corrupted, 50u);
}

TEST_F(FaultLineTest, TruncationKeepsTheHeaderAndABeginning) {
  run({{.truncate = 1.0}}, 50);
  for (const auto& sample : out_) {
    EXPECT_GE(sample.bytes().size(), 4u);
    EXPECT_LT(sample.bytes().size(), 64u);
  }
  EXPECT_EQ(line_->counters().truncated, 50u);
}

TEST_F(FaultLineTest, DuplicatesFollowTheirOriginal) {
  run({{.duplicate = 1.0}}, 2);
  EXPECT_THAT(numbers(), ElementsAre(1, 1, 2, 2));
}

TEST_F(FaultLineTest, DelayedSamplesComeLaterInOrder) {
  const auto start = std::chrono::steady_clock::now();
  run({{.delay = std::chrono::milliseconds(30)}}, 3);
  EXPECT_TRUE(numbers().empty() || std::chrono::steady_clock::now() - start >= std::chrono::milliseconds(30));
  ASSERT_TRUE(wait_for(3));
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(30));
  EXPECT_THAT(numbers(), ElementsAre(1, 2, 3));
  EXPECT_EQ(line_->counters().delayed, 3u);
}

TEST_F(FaultLineTest, ReorderedSampleComesBehindTheNextOne) {
  run({{.reorder = 1.0, .reorder_hold = std::chrono::seconds(30)}}, 4);  // 1 is held, 2 passes it, 3 is held, ...
  EXPECT_THAT(numbers(), ElementsAre(2, 1, 4, 3));
  EXPECT_EQ(line_->counters().reordered, 2u);
}

TEST_F(FaultLineTest, LastReorderedSampleComesWhenItsHoldEnds) {
  run({{.reorder = 1.0, .reorder_hold = std::chrono::milliseconds(10)}}, 1);
  ASSERT_TRUE(wait_for(1));
  EXPECT_THAT(numbers(), ElementsAre(1));
}

TEST_F(FaultLineTest, MuteSilencesUntilUnmuteAndForAnInterval) {
  run({FaultRule{}}, 1);
  line_->mute(true);
  line_->process(numbered(2));
  line_->mute(false);
  line_->process(numbered(3));
  EXPECT_THAT(numbers(), ElementsAre(1, 3));
  EXPECT_EQ(line_->counters().muted, 1u);

  run({{.mute_for = std::chrono::hours(1)}}, 3);
  EXPECT_TRUE(numbers().empty());
  run({{.mute_after = std::chrono::hours(1), .mute_for = std::chrono::hours(1)}}, 3);
  EXPECT_EQ(numbers().size(), 3u);
}

TEST_F(FaultLineTest, NothingComesAfterClose) {
  run({{.delay = std::chrono::milliseconds(5), .reorder = 0.5}}, 20);
  line_->close();
  const auto before = numbers().size();
  line_->process(numbered(21));
  DelayThread later;
  std::mutex done_mutex;
  std::condition_variable done;
  bool is_done = false;
  later.at(std::chrono::steady_clock::now() + std::chrono::milliseconds(30), [&] {
    const std::lock_guard lock(done_mutex);
    is_done = true;
    done.notify_all();
  });
  std::unique_lock lock(done_mutex);
  done.wait(lock, [&] { return is_done; });
  EXPECT_EQ(numbers().size(), before);
}

}  // namespace
}  // namespace adit::fault
