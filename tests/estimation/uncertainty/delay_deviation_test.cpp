// The delay deviations reported by a fit, compared with repeated measurements.

#include <gtest/gtest.h>

#include "tests/estimation/covariance_stage.hpp"
#include "tests/estimation/repeated_fits.hpp"

namespace stageid::test_delay_deviation {

using test::DenseProblem;

using test::kRuns;

Eigen::VectorXd joined(const Eigen::VectorXd& inputs, const Eigen::VectorXd& outputs) {
  Eigen::VectorXd out(inputs.size() + outputs.size());
  out << inputs, outputs;
  return out;
}

void expect_honest(DelayModel delay) {
  const DenseProblem problem = test::covariance_stage();
  test::RandomNumbers random(78);
  FitOptions options = test::options_with(Weighting::noise_variance);
  options.delay = delay;
  const test::RepeatedFits fits = test::repeat_fits(
      problem, options,
      [&](std::uint64_t) { return test::noisy_frf(random, problem, problem.W.cwiseInverse()); },
      [](const FrfEstimate&, const FitResult& fit) -> test::Observed {
        return {joined(fit.model.input_delay_s, fit.model.output_delay_s),
                joined(fit.model.input_delay_std_s, fit.model.output_delay_std_s)};
      });
  ASSERT_EQ(fits.reported.size(), 5);
  const Eigen::Index estimated = delay == DelayModel::estimate ? 3 : 4;
  test::expect_honest(fits.scatter.head(estimated), fits.reported.head(estimated));
  const Eigen::VectorXd truth =
      joined(problem.model.input_delays_s(), problem.model.output_delays_s());
  for (Eigen::Index d = 0; d < estimated; ++d)
    EXPECT_NEAR(fits.mean[d], truth[d], 4.0 * std::sqrt(fits.reported[d] / kRuns)) << d;
  for (Eigen::Index d = estimated; d < 5; ++d) EXPECT_EQ(fits.reported[d], 0.0) << "the reference";
}

TEST(DelayDeviation, OfOneDelay) { expect_honest(DelayModel::estimate); }

TEST(DelayDeviation, OfADelayPerChannel) { expect_honest(DelayModel::per_channel); }

TEST(DelayDeviation, UnknownOfAGivenDelay) {
  const DenseProblem problem = test::covariance_stage();
  FitOptions options = test::options_with(Weighting::relative);
  options.delay = DelayModel::fixed;
  AdditiveModel start = problem.model;
  start.input_delay_std_s.setConstant(3, 1e-6);  // of an earlier fit
  start.output_delay_std_s.setConstant(2, 1e-6);
  FrfEstimate frf = test::frf_of(problem);
  const FitResult fit = fit_additive_model(frf, start, options);
  EXPECT_EQ(fit.model.input_delay_std_s.size(), 0);
  EXPECT_EQ(fit.model.output_delay_std_s.size(), 0);
}

}  // namespace stageid::test_delay_deviation
