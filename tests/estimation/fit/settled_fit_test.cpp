// A search may take noise for a mode, and such a mode may keep the last fit from converging.

#include "estimation/fit/settled_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <complex>
#include <numbers>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/fit/mode_worth.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/search/automatic_fit.hpp"
#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test_settled_fit {

using testing::HasSubstr;

constexpr double kTrue_hz[] = {120.0, 390.0};

/// One channel with two modes, 2 % noise whose variance is known.
class SettledFit : public testing::Test {
 protected:
  void SetUp() override {
    test::RandomNumbers random(7);
    test::DenseProblem problem;
    problem.model = test::named_model(1, 1);
    problem.frequency_hz = Eigen::VectorXd::LinSpaced(150, 50.0, 500.0);
    for (const double f : kTrue_hz) {
      problem.model.submodels.push_back(test::empty_mode(problem.model, f, 0.01));
      problem.model.submodels.back().numerator[0](0, 0) =
          problem.model.submodels.back().denominator[2];
    }
    test::measure(problem);
    frf_ = test::frf_of(problem);
    frf_.noise_variance = 4e-4 * frf_.response.cwiseAbs2();
    test::add_noise(frf_, random);
    options_.weighting = Weighting::noise_variance;
    true_ = problem.model;
  }

  /// With a mode where there is none, narrower than the lines are apart.
  AdditiveModel with_a_ghost() const {
    AdditiveModel model = true_;
    model.submodels.push_back(test::empty_mode(true_, 251.2, 1e-4));
    return model;
  }

  /// Expects that the fit does not converge in so many iterations, and what becomes of it.
  void expect_settled(const AdditiveModel& start, int max_iterations, int modes,
                      const char* decision) {
    options_.max_iterations = max_iterations;
    ASSERT_FALSE(fit_additive_model(frf_, start, options_).trustworthy());
    const FitResult fit = settled_fit(frf_, start, options_);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    ASSERT_EQ(count_modes(fit.model), modes);
    ASSERT_FALSE(fit.decisions.empty());
    EXPECT_THAT(fit.decisions.front(), HasSubstr(decision));
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_NEAR(fit.model.submodels[i].natural_frequency_hz(), kTrue_hz[i], 1e-3 * kTrue_hz[i]);
  }

  FrfEstimate frf_;
  FitOptions options_;
  AdditiveModel true_;
};

TEST_F(SettledFit, AModeThatTheDataLeaveOpenIsLeftOut) {
  expect_settled(with_a_ghost(), 3, 2, "removed 25");  // the two modes begin where they are
}

// The flank of a mode above the highest line: its residue is needed, its pole is not determined.
TEST_F(SettledFit, AModeBesideTheLinesThatIsNeededKeepsItsPlace) {
  constexpr double kBeside_hz = 700.0;
  const double compliance = 0.02 * true_.submodels[1].denominator[2];
  for (Eigen::Index k = 0; k < frf_.lines(); ++k)
    frf_.response(0, k) += compliance / (1.0 - std::pow(frf_.frequency_hz[k] / kBeside_hz, 2));
  AdditiveModel start = true_;
  start.submodels.push_back(test::empty_mode(true_, kBeside_hz, 1e-4));
  expect_settled(start, 3, 3, "held the pole at");
}

// The data have a double pole: nothing that two modes with numerators B_0 reach, though the nearer they come the better
// they fit.
TEST_F(SettledFit, TwoModesThatRunIntoEachOtherBecomeOne) {
  const std::vector<double> a = test::mode_coefficients(250.0, 0.02);
  AdditiveModel twice = true_;
  twice.submodels.push_back(test::empty_submodel(true_, 0, a, 1));
  twice.submodels.push_back(test::empty_submodel(true_, 0, a, 1));
  const std::complex<double> j(0.0, 1.0);
  for (Eigen::Index k = 0; k < frf_.lines(); ++k) {
    const std::complex<double> s = j * 2.0 * std::numbers::pi * frf_.frequency_hz[k];
    const std::complex<double> A = 1.0 + a[0] * s + a[1] * s * s;
    frf_.response(0, k) += a[1] * (0.1 / A + 8e-4 / (A * A));
  }
  twice.submodels[2].denominator = {1.0, 1.02 * a[0], a[1]};
  expect_settled(twice, 16, 3, "merged");
}

// A mode so broad that its damping ratio ends at the bound converges; it is worth nothing.
TEST_F(SettledFit, AModeAtABoundThatIsWorthNothingIsLeftOut) {
  AdditiveModel broad = true_;
  broad.submodels.push_back(test::empty_mode(true_, 250.0, 0.9));
  const FitResult kept = fit_additive_model(frf_, broad, options_);
  ASSERT_TRUE(kept.trustworthy()) << kept.message();
  ASSERT_EQ(mode_verdict(frf_, ModeNumber::chosen, kept, 2), ModeVerdict::weak);
  const FitResult fit = settled_fit(frf_, broad, options_);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_EQ(count_modes(fit.model), 2);
  ASSERT_FALSE(fit.decisions.empty());
  EXPECT_THAT(fit.decisions.front(), HasSubstr("which the data do not support"));
}

TEST_F(SettledFit, AModeOnTheLinesWhosePoleIsHeldIsAFindingAndItsFitUndetermined) {
  FitResult fit = fit_additive_model(frf_, true_, options_);
  fit.model.submodels[0].held = HeldPole::guess;
  judge(frf_, {}, fit);
  ASSERT_EQ(fit.findings.size(), 1U);
  EXPECT_THAT(fit.findings[0], HasSubstr("held, because the data need it"));
  EXPECT_EQ(fit.model.submodels[0].verdict, ModeVerdict::weak);
  EXPECT_EQ(fit.status(), FitStatus::undetermined);
}

// Requested modes are kept, and such a fit is not trustworthy.
TEST_F(SettledFit, AModeThatTheDataDoNotDetermineIsAFindingAndItsFitUndetermined) {
  FitResult fit = fit_additive_model(frf_, true_, options_);
  judge(frf_, {}, fit);
  EXPECT_TRUE(fit.findings.empty());
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  const FitStatus converged = fit.status();
  fit.held = {1};
  fit.model.submodels[0].damping_ratio_std = 2.0 * fit.model.submodels[0].damping_ratio();
  judge(frf_, {}, fit);
  ASSERT_EQ(fit.findings.size(), 1U);
  EXPECT_THAT(fit.findings[0], HasSubstr(", with a standard deviation as large), 390.0"));
  EXPECT_THAT(fit.findings[0], HasSubstr("at its bound"));
  EXPECT_EQ(fit.status(), FitStatus::undetermined);
  EXPECT_THAT(fit.message(), HasSubstr("the modes at 120.003, 390.033 Hz"));
  EXPECT_EQ(fit.model.submodels[0].verdict, ModeVerdict::weak);
  EXPECT_EQ(fit.model.submodels[1].verdict, ModeVerdict::at_bound);
  fit.findings.clear();
  fit.model.fit.status = FitStatus::iteration_limit;  // the reason for not converging comes first
  judge(frf_, {}, fit);
  EXPECT_EQ(fit.findings.size(), 1U);
  EXPECT_EQ(fit.status(), FitStatus::iteration_limit);
  fit.findings.clear();
  fit.model.fit.status = converged;
  fit.model.fit.band_hz[1] = 300.0;  // outside the lines, a mode represents the rest of the plant
  fit.model.submodels[0].damping_ratio_std = 1e-4;
  judge(frf_, {}, fit);
  EXPECT_TRUE(fit.findings.empty());
  EXPECT_EQ(fit.status(), converged);
  EXPECT_EQ(fit.model.submodels[0].verdict, ModeVerdict::determined);
  EXPECT_EQ(fit.model.submodels[1].verdict, ModeVerdict::beside_band);
}

// A surplus mode follows the noise: its deviations are a few tenths of its size, and it is worth less than its
// parameters. For modes that were chosen by their worth there is no finding.
TEST_F(SettledFit, AModeThatIsAskedForAndNotWorthItsParametersIsUndetermined) {
  const auto asked = [&](int modes) {
    return automatic_fit(frf_, {.rigid_body = false}, {.modes = {}, .exactly = modes}, options_);
  };
  const FitResult two = asked(2);
  EXPECT_TRUE(two.trustworthy()) << two.message();
  EXPECT_TRUE(two.findings.empty());
  const FitResult three = asked(3);
  EXPECT_EQ(three.status(), FitStatus::undetermined) << three.message();
  EXPECT_THAT(three.message(), HasSubstr("the data do not support the modes at"));
  for (const ModeNumber number : {ModeNumber::chosen, ModeNumber::asked}) {
    const bool number_asked = number == ModeNumber::asked;
    FitResult weak = two;
    weak.removal_cost[1] = 0.9 * ModeWorth(frf_).price(two, 3.0);  // a pole and one residue
    judge(frf_, {.number = number}, weak);
    EXPECT_EQ(weak.status() == FitStatus::undetermined, number_asked);
    EXPECT_EQ(weak.message().find("390.0") != std::string::npos, number_asked) << weak.message();
    FitResult strong = two;
    strong.removal_cost[1] = 1.1 * ModeWorth(frf_).price(two, 3.0);
    judge(frf_, {.number = number}, strong);
    EXPECT_TRUE(strong.trustworthy()) << strong.message();
  }
}

TEST_F(SettledFit, TwoModesOfWhichOneDoesAsWellAreUndetermined) {
  AdditiveModel halved = true_;
  halved.submodels.push_back(test::empty_mode(true_, 1.003 * kTrue_hz[1], 0.0101));
  FitResult fit = fit_additive_model(frf_, halved, options_);
  fit.model.fit.status = FitStatus::gradient_small;
  judge(frf_, {.alike = alike_modes(frf_, options_, fit)}, fit);
  EXPECT_EQ(fit.status(), FitStatus::undetermined);
  EXPECT_THAT(fit.message(), HasSubstr("one mode fits as well"));
  EXPECT_EQ(fit.model.submodels[2].verdict, ModeVerdict::coincident);
  FitResult sound = fit_additive_model(frf_, true_, options_);
  judge(frf_, {.alike = alike_modes(frf_, options_, sound)}, sound);
  EXPECT_TRUE(sound.trustworthy()) << sound.message();
}

TEST_F(SettledFit, AFitThatConvergesIsLeftAlone) {
  const FitResult fit = settled_fit(frf_, true_, options_);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_EQ(count_modes(fit.model), 2);
  EXPECT_TRUE(fit.decisions.empty());
}

TEST_F(SettledFit, WhereNothingHelpsTheFirstFitIsReturned) {
  options_.max_iterations = 1;
  options_.deviation_tolerance = options_.gradient_tolerance = options_.step_tolerance = 0.0;
  const FitResult fit = settled_fit(frf_, with_a_ghost(), options_);
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_EQ(count_modes(fit.model), 3);
  EXPECT_TRUE(fit.decisions.empty());
}

}  // namespace stageid::test_settled_fit
