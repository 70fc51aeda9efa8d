// What happens when a measurement with correlated noise is repeated.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/repeated_fits.hpp"

namespace stageid::test_likelihood_monte_carlo {

using test::kRuns;
using test::Measurement;
using test::options_with;

test::RepeatedFits repeat(Weighting weighting, int dof) {
  return test::repeat_fits(Measurement().problem, options_with(weighting),
                           [dof](std::uint64_t run) { return Measurement(1000 + run, dof).frf; });
}

TEST(LikelihoodMonteCarlo, ScattersLessThanDiagonalWeightsAndAsMuchAsItSays) {
  const AdditiveModel truth = Measurement().problem.model;
  for (const int dof : {0, 2}) {
    const test::RepeatedFits likelihood = repeat(Weighting::likelihood, dof);
    const test::RepeatedFits diagonal = repeat(Weighting::noise_variance, dof);
    test::expect_honest(likelihood.scatter.head(6), likelihood.reported.head(6));
    for (Eigen::Index q = 0; q < 6; ++q) {
      const Submodel& mode = truth.submodels[q / 2 + 1];
      EXPECT_NEAR(likelihood.mean[q],
                  q % 2 == 0 ? mode.natural_frequency_hz() : mode.damping_ratio(),
                  4.0 * std::sqrt(likelihood.reported[q] / kRuns));
      // Half the standard deviation at most: far outside what 150 runs leave open.
      EXPECT_LT(likelihood.scatter[q], 0.25 * diagonal.scatter[q]) << dof << ", " << q;
    }
    // Gauss-Markov: the band's variance is an upper bound, here of correlations that turn.
    EXPECT_LT(likelihood.mean_response_ratio(), 1.05) << dof;
    EXPECT_GT(likelihood.mean_response_ratio(), 0.5) << dof;
  }
}

}  // namespace stageid::test_likelihood_monte_carlo
