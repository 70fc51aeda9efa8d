// A rigid body on weak springs, measured above them: 1/s^2 does not explain the lines, its modes below them do, and
// parameters that the lines do not determine are reported.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimation/search/structured_fit.hpp"
#include "tests/estimation/submodel_cases.hpp"

namespace stageid::test_suspension {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// Two rigid degrees of freedom on one suspension and a mode; the lowest line lies at 5 Hz.
test::DenseProblem suspended(double suspension_hz) {
  return test::measured({{0, mode_poles(suspension_hz, 0.1), 0}, {0, mode_poles(300.0, 0.01), 0}},
                        HoldModel::none, 0.0);
}

FitResult fit_suspended(const FrfEstimate& frf, std::vector<double> known_hz, FitOptions options) {
  RequestedStructure structure;
  structure.common.rigid_body = false;
  structure.suspension = true;
  structure.suspension_hz = std::move(known_hz);
  ModeSelection modes;
  modes.modes = {{299.0, 0.01, 1}};
  modes.keep_modes = true;
  return structured_fit(frf, structure, modes, options);
}

TEST(Suspension, IsFoundFarBelowTheLines) {
  const test::DenseProblem problem = suspended(0.4);
  const FitResult fit = fit_suspended(test::frf_of(problem), {}, {});
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), 2U);
  // The frequency affects the response by only (0.4/5)^2.
  EXPECT_NEAR(fit.model.submodels[0].natural_frequency_hz(), 0.4, 1e-6);
  EXPECT_NEAR(fit.model.submodels[0].damping_ratio(), 0.1, 1e-6);
  EXPECT_THAT(fit.decisions, Not(Contains(HasSubstr("held"))));
}

TEST(Suspension, WhereARigidBodyAloneDoesNotExplainTheLines) {
  const FrfEstimate frf = test::frf_of(suspended(0.4));
  RequestedStructure rigid;
  rigid.common.open.rigid_body = false;
  ModeSelection modes;
  modes.modes = {{299.0, 0.01, 1}};
  modes.keep_modes = true;
  EXPECT_GT(structured_fit(frf, rigid, modes, {}).model.fit.relative_rms_error, 2e-5);
  EXPECT_LT(fit_suspended(frf, {}, {}).model.fit.relative_rms_error, 1e-9);
}

/// Requests a free rigid body, the default; the delay is estimated.
FitResult fit_by_default(const test::DenseProblem& problem, double noise) {
  FitOptions options =
      test::fit_options(Weighting::noise_variance, problem.hold, DelayModel::estimate);
  return structured_fit(test::noisy(problem, noise, 4), {}, {}, options);
}

TEST(Suspension, IsFoundWhereItIsWorthItsParameters) {
  // (0.2/5)^2 = 1.6e-3 of the lowest line is the stiffness's, 2 * 0.1 * 0.2/5 its damping's, which a delay would
  // imitate. The noise is above the rounding level of the search, -160 dB.
  const double delay_s = 2e-4;
  const test::DenseProblem problem = test::measured(
      {{0, mode_poles(0.2, 0.1), 0}, {0, mode_poles(300.0, 0.01), 0}}, HoldModel::exact, delay_s);
  const FitResult fit = fit_by_default(problem, 3e-8);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("--rigid-body suspension")));
  ASSERT_EQ(fit.model.submodels.size(), 2U);
  EXPECT_EQ(fit.model.submodels[0].role, SubmodelRole::suspension);
  EXPECT_NEAR(fit.model.mean_delay_s(), delay_s, 4.0 * fit.model.input_delay_std_s[0]);
  const Submodel& mode = fit.model.submodels[1];
  EXPECT_NEAR(mode.natural_frequency_hz(), 300.0, 4.0 * *mode.natural_frequency_std_hz);
}

TEST(Suspension, IsNotFoundUnderAFreeBody) {
  const test::DenseProblem problem =
      test::measured({{2, {}, 0}, {0, mode_poles(300.0, 0.01), 0}}, HoldModel::exact, 2e-4);
  const FitResult fit = fit_by_default(problem, 1e-5);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), 2U);
  EXPECT_EQ(fit.model.submodels[0].integrators, 2);
}

TEST(Suspension, HasNoDeviationWhereTheLinesDoNotDetermineIt) {
  FitOptions options = test::fit_options(Weighting::noise_variance);
  // (0.05/5)^2 = 1e-4 of the largest line, under noise of a tenth of the mean.
  const FitResult fit = fit_suspended(test::noisy(suspended(0.05), 0.1, 6), {}, options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_FALSE(fit.model.submodels[0].natural_frequency_std_hz);
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("do not support an estimate of the frequency")));
  EXPECT_THAT(fit.held, Contains(0U));
  EXPECT_TRUE(fit.model.submodels[1].natural_frequency_std_hz);
}

TEST(Suspension, ThatIsHeldLeavesSurplusModesFlagged) {
  FitOptions options = test::fit_options(Weighting::noise_variance);
  RequestedStructure structure;
  structure.common.rigid_body = false;
  structure.suspension = true;
  ModeSelection modes;
  modes.exactly = 2;  // one is there
  const FitResult fit =
      structured_fit(test::noisy(suspended(0.05), 0.1, 6), structure, modes, options);
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("held")));
  EXPECT_EQ(fit.status(), FitStatus::undetermined) << fit.message();
}

TEST(Suspension, OfKnownFrequenciesKeepsThem) {
  test::DenseProblem problem = test::measured(
      {{0, mode_poles(0.3, 0.1), 0}, {0, mode_poles(0.8, 0.1), 0}, {0, mode_poles(300.0, 0.01), 0}},
      HoldModel::none, 0.0);
  const FitResult fit = fit_suspended(test::frf_of(problem), {0.3, 0.8}, {});
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_NEAR(fit.model.submodels[0].natural_frequency_hz(), 0.3, 1e-12);
  EXPECT_NEAR(fit.model.submodels[1].natural_frequency_hz(), 0.8, 1e-12);
  EXPECT_NEAR(fit.model.submodels[0].damping_ratio(), 0.1, 1e-3);
  EXPECT_NEAR(fit.model.submodels[1].damping_ratio(), 0.1, 1e-3);
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-8);
}

}  // namespace stageid::test_suspension
