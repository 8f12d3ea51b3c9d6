#include <gtest/gtest.h>

#include "components/state_estimator/random_updates.hpp"

namespace adit::state_estimator::test {

TEST(S0, MillionRandomUpdatesStayPositive) {
  stays_positive(1'000'000);
}

}  // namespace adit::state_estimator::test
