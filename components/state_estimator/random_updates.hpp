// Hundreds of thousands of random corrections: the covariance must stay a covariance.
#pragma once

namespace adit::state_estimator::test {

// Predictions, clones and updates with covariances over 24 decades. Reports through GoogleTest.
void stays_positive(int updates);

}  // namespace adit::state_estimator::test
