#include "components/runtime/executor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "components/runtime/testing/harness.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using testing::eventually;
using ::testing::HasSubstr;

struct Work final : Strand {
  std::atomic<int> todo{0}, done{0};
  std::atomic<bool> inside{false}, overlapped{false};
  bool run_one() override {
    if (inside.exchange(true)) overlapped = true;
    if (todo > 0) {
      --todo;
      ++done;
    }
    inside = false;
    return todo > 0;
  }
};

std::unique_ptr<Executor> start(const ExecutorConfig& config) {
  std::vector<std::string> warnings;
  auto executor = Executor::start(config, "test", warnings);
  EXPECT_TRUE(executor);
  return std::move(*executor);
}

TEST(Executor, RunsAStrandUntilItHasNoMoreWorkAndNeverTwiceAtOnce) {
  const auto executor = start({.threads = 4});
  Work work;
  executor->add(work);
  for (int i = 0; i < 10'000; ++i) {
    ++work.todo;
    executor->schedule(work);
  }
  EXPECT_TRUE(eventually([&] { return work.done == 10'000; }));
  EXPECT_FALSE(work.overlapped);
  executor->remove(work);
}

TEST(Executor, WakesAStrandAtItsAlarm) {
  const auto executor = start({.threads = 2});
  Work soon, later;
  executor->add(soon);
  executor->add(later);
  soon.todo = later.todo = 1;
  const SteadyTime now = std::chrono::steady_clock::now();
  executor->set_alarm(later, now + 1h);
  executor->set_alarm(soon, now + 20ms);
  EXPECT_TRUE(eventually([&] { return soon.done == 1; }));
  EXPECT_GE(std::chrono::steady_clock::now() - now, 20ms);
  EXPECT_EQ(later.done, 0);
  executor->remove(soon);
  executor->remove(later);
}

TEST(Executor, ABusyThreadDoesNotKeepOthersFromTheirAlarms) {
  const auto executor = start({.threads = 2});
  struct Busy final : Strand {
    std::atomic<bool> stop{false};
    bool run_one() override {
      while (!stop) std::this_thread::sleep_for(1ms);
      return false;
    }
  } busy;
  Work work;
  work.todo = 1;
  executor->add(busy);
  executor->add(work);
  executor->set_alarm(work, std::chrono::steady_clock::now() + 10ms);
  executor->schedule(busy);
  EXPECT_TRUE(eventually([&] { return work.done == 1; }, 2s));
  busy.stop = true;
  executor->remove(busy);
  executor->remove(work);
}

TEST(Executor, RefusalsBySystemAreWarningsWithARemedyOrErrors) {
  std::vector<std::string> warnings;
  const ExecutorConfig impossible{.cpus = {1000}};
  EXPECT_TRUE(Executor::start(impossible, "test", warnings));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], HasSubstr("CPUs [1000] refused"));
  EXPECT_THAT(warnings[0], HasSubstr("This machine has CPUs 0.."));

  warnings.clear();
  EXPECT_TRUE(Executor::start({.threads = 2, .priority = 500}, "test", warnings));
  ASSERT_EQ(warnings.size(), 1u);  // one for all threads
  EXPECT_THAT(warnings[0], HasSubstr("give 1..99"));

  ExecutorConfig required = impossible;
  required.required = true;
  const auto refused = Executor::start(required, "test", warnings);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("CPUs [1000] refused"));
  EXPECT_FALSE(Executor::start({.threads = 0}, "test", warnings));
}

}  // namespace
}  // namespace adit
