// A fit recovers the model of noise-free data, from starts that are near, far and at the optimum. The data are
// computed by the matrix exponential of tests/support, not by the library.

#include <gtest/gtest.h>

#include <algorithm>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_fit_recovery {

using test::DenseProblem;

struct Mode {
  double frequency_hz;
  double damping_ratio;
};

/// A stage with a rigid body and modes, its numerators at random, measured without noise.
DenseProblem measured_stage(const std::vector<Mode>& modes, HoldModel hold, int matrices = 1) {
  test::RandomNumbers random(71);
  DenseProblem problem;
  problem.model = test::named_model(3, 2);
  problem.hold = hold;
  if (hold != HoldModel::none) problem.model.sample_rate_hz = 1e4;
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(990, 20.25, 1998.25);
  problem.model.submodels.push_back(test::empty_submodel(problem.model, 2, {}, 1));
  for (const Mode& mode : modes)
    problem.model.submodels.push_back(
        test::empty_mode(problem.model, mode.frequency_hz, mode.damping_ratio, matrices));
  for (Submodel& s : problem.model.submodels) {
    double size = 0.1;
    if (s.is_mode()) size *= s.denominator[2];
    for (Eigen::MatrixXd& B : s.numerator) {
      for (double& value : B.reshaped()) value = size * random.normal();
      size /= 1e4;
    }
  }
  return problem;
}

/// The same structure with zero numerators and other modes.
AdditiveModel start_from(const DenseProblem& problem, double frequency_factor,
                         double damping_factor) {
  AdditiveModel start;
  double sign = 1.0;
  for (const Submodel& s : problem.model.submodels) {
    Submodel moved = s;
    for (Eigen::MatrixXd& B : moved.numerator) B.setZero();
    if (s.is_mode()) {
      const double frequency = s.natural_frequency_hz() * (1.0 + sign * (frequency_factor - 1.0));
      const std::vector<double> a =
          test::mode_coefficients(frequency, s.damping_ratio() * damping_factor);
      moved.denominator = {1.0, a[0], a[1]};
      sign = -sign;
    }
    start.submodels.push_back(moved);
  }
  return start;
}

/// Natural frequencies to 1e-9, damping ratios to 1e-7, numerators to 1e-6 of the largest.
/// Modes are compared in the order of frequency: two close ones may have changed places.
void expect_recovered(AdditiveModel found, const AdditiveModel& truth) {
  ASSERT_EQ(found.submodels.size(), truth.submodels.size());
  std::stable_sort(
      found.submodels.begin(), found.submodels.end(), [](const Submodel& a, const Submodel& b) {
        return a.is_mode() && b.is_mode() && a.natural_frequency_hz() < b.natural_frequency_hz();
      });
  for (std::size_t i = 0; i < truth.submodels.size(); ++i) {
    const Submodel& f = found.submodels[i];
    const Submodel& t = truth.submodels[i];
    if (t.is_mode()) {
      EXPECT_NEAR(f.natural_frequency_hz(), t.natural_frequency_hz(),
                  1e-9 * t.natural_frequency_hz());
      EXPECT_NEAR(f.damping_ratio(), t.damping_ratio(), 1e-7 * t.damping_ratio());
    }
    for (std::size_t m = 0; m < t.numerator.size(); ++m)
      EXPECT_LT((f.numerator[m] - t.numerator[m]).norm(), 1e-6 * t.numerator[m].norm())
          << "submodel " << i << ", B_" << m;
  }
}

const std::vector<Mode>& five_modes() {
  static const std::vector<Mode> modes = {
      {131.0, 0.008}, {407.3, 0.004}, {745.0, 0.012}, {752.0, 0.009}, {1610.0, 0.006}};
  return modes;
}

TEST(FitRecovery, OfModesAndDelayBehindTheHold) {
  struct Start {
    std::vector<Mode> modes;
    double frequency_factor, damping_factor;
  };
  std::vector<Mode> apart = five_modes();
  apart[3].frequency_hz = 1160.0;
  // The second is wider than any CMIF would start: poles 5 % off in turn up and down, damping ten times too large.
  for (const auto& [modes, frequency_factor, damping_factor] :
       {Start{five_modes(), 1.002, 1.6}, {apart, 1.05, 10.0}})
    for (const FitMethod method : {FitMethod::riv, FitMethod::gn}) {
      SCOPED_TRACE(testing::Message() << to_string(method) << ", " << frequency_factor);
      DenseProblem problem = measured_stage(modes, HoldModel::exact);
      problem.model.input_delay_s.setConstant(1.37e-4);
      measure(problem);
      FitOptions options =
          test::fit_options(Weighting::relative, HoldModel::exact, DelayModel::estimate);
      options.method = method;
      const FitResult fit = fit_additive_model(
          test::frf_of(problem), start_from(problem, frequency_factor, damping_factor), options);
      EXPECT_TRUE(fit.trustworthy()) << fit.message();
      expect_recovered(fit.model, problem.model);
      for (const double delay : fit.model.input_delay_s) EXPECT_NEAR(delay, 1.37e-4, 1e-10);
      EXPECT_LT(fit.model.fit.relative_rms_error, 1e-9);
      for (std::size_t i = 1; i < fit.cost.size(); ++i) EXPECT_LE(fit.cost[i], fit.cost[i - 1]);
    }
}

TEST(FitRecovery, OfContinuousDataWithoutSampleRate) {
  DenseProblem problem = measured_stage(five_modes(), HoldModel::none);
  measure(problem);
  for (const Weighting weighting :
       {Weighting::unit, Weighting::inverse_magnitude, Weighting::relative}) {
    FitOptions options = test::fit_options(weighting);
    const FitResult fit =
        fit_additive_model(test::frf_of(problem), start_from(problem, 1.001, 1.3), options);
    EXPECT_TRUE(fit.trustworthy()) << to_string(weighting) << ": " << fit.message();
    expect_recovered(fit.model, problem.model);
  }
}

TEST(FitRecovery, OfGeneralViscousDampingAndOfADelayAChannel) {
  DenseProblem problem = measured_stage({{210.0, 0.01}, {880.0, 0.006}}, HoldModel::exact, 2);
  problem.model.input_delay_s = Eigen::VectorXd{{1.3e-4, 1.52e-4}};
  problem.model.output_delay_s = Eigen::VectorXd{{0.2e-4, -0.1e-4, 0.0}};  // the last is the gauge
  measure(problem);
  FitOptions options =
      test::fit_options(Weighting::relative, HoldModel::exact, DelayModel::per_channel);
  const FitResult fit =
      fit_additive_model(test::frf_of(problem), start_from(problem, 1.001, 1.3), options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  expect_recovered(fit.model, problem.model);
  EXPECT_LT((fit.model.input_delay_s - problem.model.input_delay_s).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LT((fit.model.output_delay_s - problem.model.output_delay_s).cwiseAbs().maxCoeff(), 1e-10);
}

// 17 delays of the paper's channels, noise of a hundredth of the response on every line.
TEST(FitRecovery, DelaysOfAllChannelsAt40DecibelWithinATenthOfAMicrosecond) {
  test::RandomStageSpec spec;
  spec.least_modes = spec.most_modes = 8;
  spec.line_spacing_hz = 1.0;
  test::RandomStage stage = test::draw_random_stage(9, spec);
  test::RandomNumbers random(10);
  test::add_relative_noise(stage.exact, 0.01, random);
  stage.frf.response = stage.exact;
  stage.frf.noise_variance = 1e-4 * stage.exact.cwiseAbs2();
  FitOptions options =
      test::fit_options(Weighting::relative, HoldModel::exact, DelayModel::per_channel);
  AdditiveModel start;
  start.submodels = stage.truth.submodels;
  const FitResult fit = fit_additive_model(stage.frf, start, options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.input_delay_s.size(), 13);
  for (const double input : fit.model.input_delay_s)
    for (const double output : fit.model.output_delay_s)
      EXPECT_NEAR(input + output, stage.delay_s, 1e-7);
}

// The same with noise: fitted again from its own result, nothing moves.
TEST(FitRecovery, AFitFromItsOwnResultStaysPut) {
  DenseProblem problem = measured_stage(five_modes(), HoldModel::none);
  measure(problem);
  test::RandomNumbers random(5);
  test::add_relative_noise(problem.G, 0.02, random);
  const FrfEstimate frf = test::frf_of(problem);
  const FitResult once = fit_additive_model(frf, start_from(problem, 1.002, 1.5), {});
  ASSERT_TRUE(once.trustworthy()) << once.message();
  const FitResult twice = fit_additive_model(frf, once.model, {});
  EXPECT_TRUE(twice.trustworthy());
  EXPECT_LE(twice.model.fit.iterations, 2);
  for (std::size_t i = 1; i < once.model.submodels.size(); ++i) {
    const double f = once.model.submodels[i].natural_frequency_hz();
    EXPECT_NEAR(twice.model.submodels[i].natural_frequency_hz(), f,
                3e-4 * once.model.submodels[i].natural_frequency_std_hz.value_or(f))
        << "moved by more than the tolerance of the iteration, 1e-4 of its standard deviation";
  }
}

// One sharp mode a tenth of its width off, at 70 dB over the noise: its phase error at its peak
// must not decide the delay of everything (it did, by 600 us).
TEST(FitRecovery, TheDelayIsFoundThoughASharpModeIsOff) {
  DenseProblem problem =
      measured_stage({{81.13, 0.002}, {475.5, 0.0023}, {1362.0, 0.0036}}, HoldModel::exact);
  problem.model.input_delay_s.setConstant(1.356e-4);
  measure(problem);
  FrfEstimate frf = test::frf_of(problem);
  test::RandomNumbers random(36);
  const double floor = 1e-3 * problem.G.cwiseAbs().minCoeff();
  frf.noise_variance =
      Eigen::MatrixXd::Constant(frf.response.rows(), frf.response.cols(), floor * floor);
  for (std::complex<double>& value : frf.response.reshaped()) value += floor * random.circular();
  FitOptions options =
      test::fit_options(Weighting::noise_variance, HoldModel::exact, DelayModel::estimate);
  const FitResult fit = fit_additive_model(frf, start_from(problem, 1.0015, 1.8), options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_NEAR(fit.model.input_delay_s[0], 1.356e-4, 1e-8);
}

// Planted faults: each of these data would be fitted well by a program that made the matching
// mistake, so they must not be.
TEST(FitRecovery, ConjugatedDataAndRadiansForHertzAreNotFittedByTheTruth) {
  DenseProblem problem = measured_stage(five_modes(), HoldModel::none);
  measure(problem);
  FitOptions stay;
  stay.max_iterations = 0;
  FrfEstimate frf = test::frf_of(problem);
  const double right = fit_additive_model(frf, problem.model, stay).model.fit.relative_rms_error;
  EXPECT_LT(right, 1e-9);
  FrfEstimate conjugated = frf;
  conjugated.response = frf.response.conjugate();
  EXPECT_GT(fit_additive_model(conjugated, problem.model, stay).model.fit.relative_rms_error, 0.02);
  FrfEstimate radians = frf;
  radians.frequency_hz = frf.omega_rad_s();
  EXPECT_GT(fit_additive_model(radians, problem.model, stay).model.fit.relative_rms_error, 0.1);
}

}  // namespace stageid::test_fit_recovery
