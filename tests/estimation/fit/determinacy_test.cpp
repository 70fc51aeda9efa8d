// Structures that the data do not support: the fit ends, names the submodel, and returns neither an unstable pole nor
// a number that is not finite.

#include "estimation/fit/determinacy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimation/search/structured_fit.hpp"
#include "tests/estimation/submodel_cases.hpp"

namespace stageid::test_determinacy {

using testing::HasSubstr;

const std::vector<test::Part>& one_mode() {
  static const std::vector<test::Part> parts = {{0, mode_poles(200.0, 0.02), 1}};
  return parts;
}

void expect_stable_and_finite(const FitResult& fit) {
  for (const Submodel& s : fit.model.submodels) {
    EXPECT_TRUE(std::isfinite(s.natural_frequency_std_hz.value_or(0.0)));
    for (const Eigen::MatrixXd& B : s.numerator) EXPECT_TRUE(B.allFinite());
    const Eigen::VectorXd a = Eigen::Map<const Eigen::VectorXd>(
        s.denominator.data() + 1, static_cast<Eigen::Index>(s.denominator.size()) - 1);
    EXPECT_TRUE(a.allFinite());
    for (const std::complex<double> pole : roots(a)) EXPECT_LT(pole.real(), 0.0);
  }
  for (const double cost : fit.cost) EXPECT_TRUE(std::isfinite(cost));
  EXPECT_TRUE(std::isfinite(fit.model.fit.cost));
  EXPECT_TRUE(fit.response_variance.allFinite());
}

TEST(Determinacy, TwoSubmodelsOnOnePoleAreNamed) {
  const FrfEstimate frf = test::frf_of(test::measured(one_mode(), HoldModel::none, 0.0));
  const FitResult fit = test::fit_submodels(
      frf, {{{0, 2, 1}, false, {199.0}, {0.02}}, {{0, 2, 1}, false, {199.0}, {0.02}}});
  EXPECT_FALSE(fit.trustworthy());
  // They remain together, or one of them takes the mode and the other is left with rounding.
  EXPECT_THAT(fit.message(),
              testing::AnyOf(testing::ContainsRegex("numerators of submodel 1 .* and submodel 2 "),
                             testing::ContainsRegex("submodel [12] .l=0, n=2, m=1.*rounding")));
  expect_stable_and_finite(fit);
}

TEST(Determinacy, AnOrderThatNoiseFreeDataDoNotHave) {
  const FrfEstimate frf = test::frf_of(test::measured(one_mode(), HoldModel::none, 0.0));
  const FitResult fit = test::fit_submodels(frf, {{{0, 6, 5}, false, {50.0, 201.0, 700.0}, {}}});
  EXPECT_EQ(fit.status(), FitStatus::undetermined) << fit.message();
  EXPECT_THAT(fit.message(), HasSubstr("submodel 1 (l=0, n=6, m=5"));
  expect_stable_and_finite(fit);
}

TEST(Determinacy, ARealPoleThatIsOnlyNoiseIsNotTrusted) {
  const FrfEstimate frf = test::noisy(test::measured(one_mode(), HoldModel::none, 0.0), 0.05, 2);
  FitOptions options = test::fit_options(Weighting::noise_variance);
  const FitResult fit = test::fit_submodels(
      frf, {{{0, 2, 1}, false, {201.0}, {}}, {{0, 1, 0}, false, {80.0}, {}}}, options);
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_THAT(fit.message(), HasSubstr("submodel 2 (l=0, n=1, m=0"));
  expect_stable_and_finite(fit);
}

TEST(Determinacy, ARealPoleFarAboveTheLinesStandsAtItsBound) {
  // A constant: the pole runs away.
  const FrfEstimate frf =
      test::frf_of(test::measured({{0, {}, 0}, one_mode()[0]}, HoldModel::none, 0.0));
  const FitResult fit =
      test::fit_submodels(frf, {{{0, 2, 1}, false, {201.0}, {}}, {{0, 1, 0}, false, {900.0}, {}}});
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_THAT(fit.message(), HasSubstr("submodel 2 (l=0, n=1, m=0, pole at 9990 Hz)"));
  EXPECT_THAT(fit.held, testing::Contains(1U));
  expect_stable_and_finite(fit);
}

// Unstable data (poles on the right): orders above two have no bound to be held at, and must still end
// on the left and without trust.
TEST(Determinacy, DataOfAnUnstablePlantAreNotFittedByAnUnstableModel) {
  test::Poles poles = mode_poles(200.0, 0.02);
  for (const std::complex<double> pole : mode_poles(400.0, 0.01)) poles.push_back(-std::conj(pole));
  const FrfEstimate frf = test::frf_of(test::measured({{0, poles, 3}}, HoldModel::none, 0.0));
  const FitResult fit = test::fit_submodels(frf, {{{0, 4, 3}, false, {201.0, 399.0}, {}}});
  EXPECT_FALSE(fit.trustworthy()) << fit.message();
  expect_stable_and_finite(fit);
}

TEST(Determinacy, StartsAtRandomNeverEndUnstable) {
  test::RandomNumbers random(91);
  const test::DenseProblem problem =
      test::measured({{0, test::joined(mode_poles(130.0, 0.02), mode_poles(410.0, 0.01)), 3},
                      {0, {test::real_pole(60.0)}, 0}},
                     HoldModel::none, 0.0);
  FitOptions options;
  options.max_iterations = 40;
  for (int i = 0; i < 60; ++i) {
    const FrfEstimate frf =
        test::noisy(problem, i % 2 == 0 ? 1e-3 : 0.3, 100U + static_cast<unsigned>(i));
    const FitMethod methods[] = {FitMethod::riv, FitMethod::gn, FitMethod::sk};
    options.method = methods[i % 3];
    options.weighting = i % 4 < 2 ? Weighting::relative : Weighting::noise_variance;
    const int n = random.integer(1, 5);
    std::vector<double> frequency_hz;
    for (int p = 0; p < (n + 1) / 2; ++p)
      frequency_hz.push_back(std::pow(10.0, random.uniform(0.0, 3.5)));
    const double damping = std::pow(10.0, random.uniform(-4.0, -0.1));
    std::vector<SubmodelRequest> submodels = {
        {{0, n, random.integer(0, n)},
         false,
         frequency_hz,
         n > 1 ? std::vector<double>{damping} : std::vector<double>{}},
        {{random.integer(0, 2), 0, 0}, false, {}, {}}};
    if (submodels[0].biproper() && submodels[1].biproper()) submodels.pop_back();
    SCOPED_TRACE(testing::Message()
                 << "start " << i << ", n " << n << ", " << to_string(options.method));
    expect_stable_and_finite(test::fit_submodels(frf, submodels, options));
  }
}

}  // namespace stageid::test_determinacy
