// The delay deviations reported by a fit, compared with repeated measurements.

#include <gtest/gtest.h>

#include "estimation/search/fit_additive_model.hpp"
#include "tests/estimation/covariance_stage.hpp"
#include "tests/estimation/delayed_fit_options.hpp"

namespace stageid {
namespace test_delay_deviation {

using test::DenseProblem;

constexpr int kRuns = 150;
// chi^2 of 149 degrees of freedom over its mean lies in here with 99.99 % (Wilson and Hilferty).
constexpr double kLowest = 0.62;
constexpr double kHighest = 1.52;

struct Delays {
  Eigen::VectorXd values;
  Eigen::VectorXd deviations;
};

Delays delays_of(const AdditiveModel& model) {
  Delays out{Eigen::VectorXd(model.n_inputs() + model.n_outputs()), {}};
  out.values << model.input_delay_s, model.output_delay_s;
  out.deviations.resize(out.values.size());
  out.deviations << model.input_delay_std_s, model.output_delay_std_s;
  return out;
}

void expect_honest(DelayModel delay) {
  const DenseProblem problem = test::covariance_stage();
  test::RandomNumbers random(78);
  FitOptions options = test::options_with(Weighting::noise_variance);
  options.delay = delay;
  options.threads = 1;
  const Delays truth{
      (Eigen::VectorXd(5) << problem.model.input_delays_s(), problem.model.output_delays_s())
          .finished(),
      {}};
  Eigen::MatrixXd values(5, kRuns);
  Eigen::VectorXd reported = Eigen::VectorXd::Zero(5);
  for (int run = 0; run < kRuns; ++run) {
    FrfEstimate frf = test::frf_of(problem);
    frf.noise_variance = problem.W.cwiseInverse();
    frf.response = test::noisy(random, problem, frf.noise_variance);
    const FitResult fit = fit_additive_model(frf, problem.model, options);
    ASSERT_TRUE(fit.trustworthy()) << fit.message;
    ASSERT_EQ(fit.model.input_delay_std_s.size(), 3);
    ASSERT_EQ(fit.model.output_delay_std_s.size(), 2);
    const Delays found = delays_of(fit.model);
    values.col(run) = found.values;
    reported += found.deviations.cwiseAbs2() / kRuns;
  }
  const Eigen::Index estimated = delay == DelayModel::estimate ? 3 : 4;
  for (Eigen::Index d = 0; d < estimated; ++d) {
    const double mean = values.row(d).mean();
    const double scatter = (values.row(d).array() - mean).square().sum() / (kRuns - 1);
    EXPECT_GT(scatter / reported[d], kLowest) << "delay " << d;
    EXPECT_LT(scatter / reported[d], kHighest) << "delay " << d;
    EXPECT_NEAR(mean, truth.values[d], 4.0 * std::sqrt(reported[d] / kRuns)) << "delay " << d;
  }
  for (Eigen::Index d = estimated; d < 5; ++d) EXPECT_EQ(reported[d], 0.0) << "the reference";
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

}  // namespace test_delay_deviation
}  // namespace stageid
