#include "components/runtime/trigger.hpp"

#include <gtest/gtest.h>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/harness.hpp"

namespace adit {
namespace {

using testing::eventually;
using testing::Harness;

struct Worker final : Component {
  std::atomic<int> calls{0};
  Trigger trigger{*this, [this] { ++calls; }};
  Result<void> activate() override {
    if (raise_in_activate) trigger.raise();
    return {};
  }
  bool raise_in_activate = false;
};

TEST(Trigger, RaisedSeveralTimesBeforeTheStrandRunsItCallsOnce) {
  Harness harness;
  auto& worker = harness.make<Worker>("worker");
  harness.start();
  harness.step();
  EXPECT_EQ(worker.calls, 0);
  for (int i = 0; i < 3; ++i) worker.trigger.raise();
  harness.step();
  EXPECT_EQ(worker.calls, 1);
  worker.trigger.raise();
  harness.step();
  EXPECT_EQ(worker.calls, 2);
}

TEST(Trigger, WhatWasRaisedBeforeActivationIsForgottenAndTheNextOneWorks) {
  Harness harness;
  auto& worker = harness.make<Worker>("worker");
  worker.trigger.raise();
  harness.start();
  harness.step();
  EXPECT_EQ(worker.calls, 0);
  worker.trigger.raise();
  harness.step();
  EXPECT_EQ(worker.calls, 1);
}

TEST(Trigger, RaisedInActivateItIsCalledOnceActive) {
  Harness harness(2);
  auto& worker = harness.make<Worker>("worker");
  worker.raise_in_activate = true;
  harness.start();
  EXPECT_TRUE(eventually([&] { return worker.calls == 1; }));
}

TEST(Trigger, RaisedFromManyThreadsTheLastOneIsSeen) {
  Harness harness(2);
  auto& worker = harness.make<Worker>("worker");
  harness.start();
  for (int round = 0; round < 50; ++round) {
    const int before = worker.calls;
    std::vector<std::jthread> threads;
    for (int i = 0; i < 4; ++i) threads.emplace_back([&] { worker.trigger.raise(); });
    threads.clear();
    ASSERT_TRUE(eventually([&] { return worker.calls > before; })) << round;
  }
}

}  // namespace
}  // namespace adit
