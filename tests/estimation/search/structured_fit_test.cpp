// Poles without start values, and one denominator for several modes. The same model set written as modes with B_0 +
// B_1 s is the independent reference: response, cost and standard deviations must agree.

#include "estimation/search/structured_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/estimation/submodel_cases.hpp"
#include "tests/support/models/expect_same_fit.hpp"

namespace stageid::test_structured_fit {

using test::DenseProblem;
using test::Part;

/// Modes over most of the band, damping ratio 0.01.
std::vector<Part> modes(int count) {
  std::vector<Part> out;
  for (int i = 0; i < count; ++i)
    out.push_back(
        {0, mode_poles(40.0 * std::pow(800.0 / 40.0, i / std::max(count - 1.0, 1.0)), 0.01), 1});
  return out;
}

class OneDenominator : public testing::TestWithParam<int> {};

TEST_P(OneDenominator, GivesBackNoiseFreeModes) {
  const int K = GetParam();
  const DenseProblem problem = test::measured(modes(K), HoldModel::exact, 2e-4);
  FitOptions options =
      test::fit_options(Weighting::relative, HoldModel::exact, DelayModel::fixed, 2e-4);
  const FitResult fit =
      test::fit_submodels(test::frf_of(problem), {{{0, 2 * K, 2 * K - 1}, false, {}, {}}}, options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), 1U);
  // Digits go with the square of the condition of s^m / A, which is 5e3 for eight modes.
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-9);
  const Eigen::MatrixXcd P =
      test::reference_response(fit.model, problem.frequency_hz, problem.hold);
  EXPECT_LT((P - problem.G).norm(), 1e-8 * problem.G.norm());
}

TEST_P(OneDenominator, HasTheCostAndTheDeviationsOfItsModes) {
  const int K = GetParam();
  const DenseProblem problem = test::measured(modes(K), HoldModel::none, 0.0);
  const FrfEstimate frf = test::noisy(problem, 1e-3, 5);
  FitOptions options = test::fit_options(Weighting::noise_variance);
  const FitResult one = test::fit_submodels(frf, {{{0, 2 * K, 2 * K - 1}, false, {}, {}}}, options);
  const FitResult apart = fit_additive_model(frf, problem.model, options);
  EXPECT_TRUE(one.trustworthy()) << one.message();
  EXPECT_NEAR(one.model.fit.cost, apart.model.fit.cost, 1e-7 * apart.model.fit.cost);
  const std::vector<PoleEstimate>& poles = one.model.submodels[0].poles;
  ASSERT_EQ(poles.size(), static_cast<std::size_t>(K));
  for (std::size_t i = 0; i < poles.size(); ++i) {
    const Submodel& mode = apart.model.submodels[i];
    const double deviation_hz = mode.natural_frequency_std_hz.value();
    EXPECT_NEAR(poles[i].natural_frequency_hz, mode.natural_frequency_hz(), 1e-2 * deviation_hz);
    EXPECT_NEAR(poles[i].natural_frequency_std_hz.value(), deviation_hz, 1e-2 * deviation_hz);
    EXPECT_NEAR(poles[i].damping_ratio_std.value(), mode.damping_ratio_std.value(),
                1e-2 * mode.damping_ratio_std.value());
  }
}

INSTANTIATE_TEST_SUITE_P(Of, OneDenominator, testing::Values(2, 3, 5, 8));

TEST(StructuredFit, OfAutomaticOrderTakesAsManyModesAsThereAre) {
  const DenseProblem problem = test::measured({{0, mode_poles(130.0, 0.02), 1},
                                               {0, mode_poles(330.0, 0.01), 1},
                                               {0, mode_poles(700.0, 0.015), 1}},
                                              HoldModel::none, 0.0);
  FitOptions options = test::fit_options(Weighting::noise_variance);
  const FitResult fit =
      test::fit_submodels(test::noisy(problem, 1e-3, 8), {{{}, true, {}, {}}}, options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), 1U);
  EXPECT_EQ(fit.model.submodels[0].denominator.size(), 7U);
  EXPECT_EQ(fit.model.submodels[0].numerator.size(), 6U);
}

/// A real pole and four modes, the first two of them in one submodel, and an integrator.
std::vector<Part> mixed_plant() {
  return {{1, {}, 0},
          {0, {test::real_pole(60.0)}, 0},
          {0, test::joined(mode_poles(130.0, 0.01), mode_poles(210.0, 0.01)), 3},
          {0, mode_poles(420.0, 0.01), 0},
          {0, mode_poles(700.0, 0.01), 0}};
}

RequestedStructure mixed_request() {
  RequestedStructure structure;
  structure.common.rigid_body = false;
  structure.submodels = {
      {{1, 0, 0}, false, {}, {}}, {{0, 1, 0}, false, {}, {}}, {{0, 4, 3}, false, {}, {}}};
  return structure;
}

TEST(StructuredFit, FindsThePolesThatNobodyGaveBesideGivenModes) {
  const DenseProblem problem = test::measured(mixed_plant(), HoldModel::none, 0.0);
  FitOptions options;
  options.max_iterations = 300;
  const FitResult fit = test::fit_submodels(test::frf_of(problem), mixed_request().submodels,
                                            options, {{419.0, 0.01, 1}, {702.0, 0.01, 1}});
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-9);
  ASSERT_EQ(fit.model.submodels.size(), 5U);
  EXPECT_NEAR(fit.model.submodels[1].poles.at(0).natural_frequency_hz, 60.0, 1e-6);
  EXPECT_NEAR(fit.model.submodels[2].poles.at(0).natural_frequency_hz, 130.0, 1e-6);
  EXPECT_NEAR(fit.model.submodels[2].poles.at(1).natural_frequency_hz, 210.0, 1e-6);
  EXPECT_THAT(fit.decisions, testing::Contains(testing::HasSubstr("poles start at the modes")));
  EXPECT_THAT(fit.decisions, testing::Contains(testing::HasSubstr("its real pole starts at")));
}

TEST(StructuredFit, ASearchBesideKeepsWhatWasGiven) {
  const DenseProblem problem = test::measured(mixed_plant(), HoldModel::none, 0.0);
  RequestedStructure structure = mixed_request();
  structure.submodels[1].frequency_hz = {70.0};
  structure.submodels[2].frequency_hz = {131.0, 208.0};
  FitOptions options = test::fit_options(Weighting::noise_variance);
  const FitResult fit = structured_fit(test::noisy(problem, 1e-4, 3), structure, {}, options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), 5U);
  EXPECT_EQ(fit.model.submodels[2].denominator.size(), 5U);
  EXPECT_NEAR(fit.model.submodels[3].natural_frequency_hz(), 420.0, 0.1);
  EXPECT_NEAR(fit.model.submodels[4].natural_frequency_hz(), 700.0, 0.1);
}

TEST(StructuredFit, DoesNotDependOnTheNumberOfThreads) {
  const FrfEstimate frf = test::noisy(test::measured(mixed_plant(), HoldModel::none, 0.0), 1e-3, 4);
  const auto fit_with = [&](int threads) {
    FitOptions options;
    options.threads = threads;
    return structured_fit(frf, mixed_request(), {}, options);
  };
  test::expect_same(fit_with(1), fit_with(3));
}

}  // namespace stageid::test_structured_fit
