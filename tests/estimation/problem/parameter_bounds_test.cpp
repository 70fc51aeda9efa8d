// Data whose best pole is outside the stable or visible range: the fit ends at the bound and has converged.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/estimation/covariance_stage.hpp"

namespace stageid::test_parameter_bounds {

constexpr double kLowestLineHz = 20.0;

/// One input, one output, rigid body and two modes, 2 Hz between lines; no noise.
FrfEstimate response_of(double first_hz, double first_damping) {
  test::DenseProblem problem;
  problem.model = test::named_model(1, 1);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(241, kLowestLineHz, 500.0);
  problem.model.submodels = {test::empty_submodel(problem.model, 2, {}, 1),
                             test::empty_mode(problem.model, first_hz, first_damping),
                             test::empty_mode(problem.model, 301.0, 0.01)};
  for (Submodel& s : problem.model.submodels)
    s.numerator[0](0, 0) = s.is_mode() ? s.denominator[2] : 1.0;
  test::measure(problem);
  return test::frf_of(problem);
}

FitResult fit_from(const FrfEstimate& frf, double first_hz) {
  AdditiveModel start = test::named_model(1, 1);
  start.submodels.push_back(test::empty_submodel(start, 2, {}, 1));
  for (const double f : {first_hz, 300.0})
    start.submodels.push_back(test::empty_mode(start, f, 0.01));
  return fit_additive_model(frf, start, {});
}

TEST(ParameterBounds, AModeThatWouldBeUnstableIsHeldAtTheSmallestDamping) {
  const FitResult fit = fit_from(response_of(121.0, -0.002), 120.5);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_NEAR(fit.model.submodels[1].damping_ratio(), 1e-5, 1e-8);
  EXPECT_NEAR(fit.model.submodels[1].natural_frequency_hz(), 121.0, 0.1);
  EXPECT_FALSE(fit.model.submodels[1].damping_ratio_std) << "it is not an unknown any more";
  EXPECT_NEAR(fit.model.submodels[2].natural_frequency_hz(), 301.0, 0.1);
}

TEST(ParameterBounds, AModeFarBelowTheLinesIsHeldThereWithoutADeviation) {
  // From a start inside the lines towards 1 Hz, which is seen as a slope only.
  const FitResult fit = fit_from(response_of(1.0, 0.02), 30.0);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_NEAR(fit.model.submodels[1].natural_frequency_hz(), kLowestLineHz / 4.0, 1e-6);
  EXPECT_FALSE(fit.model.submodels[1].natural_frequency_std_hz);
  EXPECT_NEAR(fit.model.submodels[2].natural_frequency_hz(), 301.0, 0.1);
}

/// Of 20 noisy measurements of a stage with two samples of delay and a direct term, the fits from this delay that are
/// trustworthy and find the delay.
int found_from(double delay_s, const FitOptions& given) {
  test::RandomNumbers random(5);
  test::DenseProblem problem =
      test::stage_2x3(HoldModel::exact, random, {{310.0, 0.02}, {900.0, 0.015}});
  problem.model.hold = HoldModel::exact;
  problem.model.input_delay_s.setConstant(2e-4);
  problem.model.submodels.push_back(test::empty_submodel(problem.model, 0, {}, 1));
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(180, 40.0, 1500.0);
  const double size =
      0.1 *
      test::reference_response(problem.model, problem.frequency_hz, problem.hold).cwiseAbs().mean();
  for (double& value : problem.model.submodels.back().numerator[0].reshaped())
    value = size * random.normal();
  test::measure(problem);
  const Eigen::MatrixXd variance =
      Eigen::MatrixXd::Constant(problem.channels(), 180, 1e-4 * size * size);
  FitOptions options = given;
  options.delay = DelayModel::estimate;
  options.delay_s = delay_s;
  int found = 0;
  for (int run = 0; run < 20; ++run) {
    const FitResult fit = fit_additive_model(test::noisy_frf(random, problem, variance),
                                             test::moved(problem.model, 1.001, 1.0), options);
    const double error_s = fit.model.input_delays_s()[0] - 2e-4;
    if (fit.trustworthy() && fit.model.input_delay_std_s.size() > 0 &&
        std::abs(error_s) < 5.0 * fit.model.input_delay_std_s[0])
      ++found;
  }
  return found;
}

// A direct term answers one sample later as soon as the delay exceeds a whole number of samples.
TEST(ParameterBounds, ADelayOfWholeSamplesIsFoundFromBothSides) {
  FitOptions options = test::fit_options(Weighting::noise_variance, HoldModel::exact);
  options.threads = 1;
  for (const double delay_s : {1.9e-4, 1.999e-4, 2.001e-4, 2.1e-4})
    EXPECT_EQ(found_from(delay_s, options), 20) << delay_s;
  options.residue_rank = 2;
  EXPECT_EQ(found_from(1.9e-4, options), 20);
}

}  // namespace stageid::test_parameter_bounds
