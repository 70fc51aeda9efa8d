// Modes at the same frequency: the required rank of a residue, and the result of a fit with rank one.

#include "estimation/fit/ranked_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "estimation/fit/coincident_modes.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/search/automatic_fit.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test_ranked_fit {

using testing::Contains;
using testing::HasSubstr;

constexpr double kDamping = 0.01;
constexpr double kPlace_hz = 150.0;

/// 3 x 3 on 20 to 400 Hz, 1 % noise whose variance is known: a rigid body, and modes of random shapes.
class CoincidentModes : public testing::Test {
 protected:
  explicit CoincidentModes(std::uint64_t seed = 21) : random_(seed) {
    problem_.model = test::named_model(3, 3);
    problem_.frequency_hz = Eigen::VectorXd::LinSpaced(400, 20.0, 400.0);
    problem_.model.submodels.push_back(test::empty_submodel(problem_.model, 2, {}, 1));
    problem_.model.submodels[0].numerator[0] = 0.1 * test::random_matrix(random_, 3, 3);
    options_.weighting = Weighting::noise_variance;
  }

  void add_mode(double frequency_hz, int rank) {
    problem_.model.submodels.push_back(test::empty_mode(problem_.model, frequency_hz, kDamping));
    Submodel& s = problem_.model.submodels.back();
    s.numerator[0] = s.denominator[2] * test::random_matrix(random_, 3, rank) *
                     test::random_matrix(random_, rank, 3);
  }

  FrfEstimate measured() {
    test::measure(problem_);
    FrfEstimate frf = test::frf_of(problem_);
    frf.noise_variance = 1e-4 * frf.response.cwiseAbs2();
    test::add_noise(frf, random_);
    return frf;
  }

  static std::vector<const Submodel*> modes(const FitResult& fit) {
    std::vector<const Submodel*> out;
    for (const Submodel& s : fit.model.submodels)
      if (s.is_mode()) out.push_back(&s);
    return out;
  }

  static double second_share(const Submodel& s) {
    const Eigen::VectorXd values = svd(s.numerator[0], 0).singularValues();
    return values[1] / values[0];
  }

  static void expect_pair(const Submodel& a, const Submodel& b, double apart_hz, double error_hz) {
    const double f = a.natural_frequency_hz();
    const double g = b.natural_frequency_hz();
    EXPECT_NEAR(std::min(f, g), kPlace_hz, error_hz);
    EXPECT_NEAR(std::max(f, g), kPlace_hz + apart_hz, error_hz);
  }

  /// The cost that noise leaves: channels / 2 with the right variances.
  static constexpr double kNoiseCost = 4.5;

  test::RandomNumbers random_;
  test::DenseProblem problem_;
  FitOptions options_;
};

// Of a residue that is of rank one the distance from it is chi-square distributed; of one that is not, no noise
// explains it.
TEST_F(CoincidentModes, TheDistanceFromRankOneIsChiSquareOnlyWhereTheRankIsOne) {
  add_mode(100.0, 1);
  add_mode(kPlace_hz, 2);
  add_mode(260.0, 3);
  constexpr int kRuns = 60;
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const FitResult fit = fit_additive_model(measured(), problem_.model, options_);
    ASSERT_EQ(fit.residue_ranks.size(), 3U) << fit.message();
    EXPECT_EQ(fit.residue_ranks[0].rank, 1);
    EXPECT_EQ(fit.residue_ranks[0].parameters, 4);
    EXPECT_EQ(fit.residue_ranks[1].rank, 2);
    EXPECT_EQ(fit.residue_ranks[2].rank, 3);
    EXPECT_LT(fit.residue_ranks[1].probability, 1e-12);
    sum += fit.residue_ranks[0].chi_square;
  }
  // The mean of 60 chi-squares of 4: 4 with a deviation of sqrt(8 / 60) = 0.37; three of them.
  EXPECT_NEAR(sum / kRuns, 4.0, 1.1);
}

TEST_F(CoincidentModes, OneModeOfRankTwoIsTwoOfRankOne) {
  add_mode(kPlace_hz, 2);
  options_.residue_rank = 1;
  const FitResult fit = automatic_fit(measured(), {}, {}, options_);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_NEAR(fit.model.fit.cost, kNoiseCost, 0.05 * kNoiseCost);
  const auto found = modes(fit);
  ASSERT_EQ(found.size(), 2U);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(3, 3);
  for (const Submodel* s : found) {
    EXPECT_NEAR(s->natural_frequency_hz(), kPlace_hz, 4.0 * s->natural_frequency_std_hz.value());
    EXPECT_EQ(s->residue_rank, 1);
    EXPECT_LT(second_share(*s), 1e-12);
    sum += s->numerator[0];
  }
  const Eigen::MatrixXd& truth = problem_.model.submodels[1].numerator[0];
  EXPECT_LT((sum - truth).norm(), 0.01 * truth.norm());
  EXPECT_EQ(fit.removal_cost.size(), fit.model.submodels.size());
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("counts as 2 modes of rank one")));
  EXPECT_TRUE(fit.findings.empty());
}

TEST_F(CoincidentModes, TwoModesThatAreAskedForComeToRest) {
  add_mode(kPlace_hz, 2);
  options_.residue_rank = 1;
  const FrfEstimate frf = measured();
  const FitResult asked = automatic_fit(frf, {}, {.modes = {}, .exactly = 2}, options_);
  const FitResult named = automatic_fit(
      frf, {}, {.modes = {{150.0, 0.01, 1}, {150.05, 0.01, 1}}, .keep_modes = true}, options_);
  for (const FitResult* fit : {&asked, &named}) {
    EXPECT_TRUE(fit->trustworthy()) << fit->message();
    EXPECT_EQ(modes(*fit).size(), 2U);
    EXPECT_NEAR(fit->model.fit.cost, kNoiseCost, 0.05 * kNoiseCost);
  }
}

// The search puts the third of three modes on noise; the second shape of another is worth more.
TEST_F(CoincidentModes, OfANumberThatIsAskedForTheLeastMakesRoom) {
  add_mode(kPlace_hz, 2);
  add_mode(260.0, 1);
  options_.residue_rank = 1;
  const FitResult fit = automatic_fit(measured(), {}, {.modes = {}, .exactly = 3}, options_);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(modes(fit).size(), 3U);
  EXPECT_NEAR(modes(fit)[1]->natural_frequency_hz(), kPlace_hz, 0.1);
  EXPECT_NEAR(modes(fit)[2]->natural_frequency_hz(), 260.0, 0.1);
  EXPECT_NEAR(fit.model.fit.cost, kNoiseCost, 0.05 * kNoiseCost);
}

TEST_F(CoincidentModes, ARankThatDoesNotSufficeIsAFinding) {
  add_mode(kPlace_hz, 2);
  options_.residue_rank = 1;
  const FitResult fit = automatic_fit(measured(), {}, {.modes = {}, .exactly = 1}, options_);
  EXPECT_GT(fit.model.fit.cost, 10.0 * kNoiseCost);
  EXPECT_THAT(fit.findings, Contains(HasSubstr("rank 1 is too low for the residues at 150")));
  EXPECT_THAT(fit.findings, Contains(HasSubstr("--residue-rank 2")));
}

TEST_F(CoincidentModes, ACloseRankOnePairIsTakenApart) {
  add_mode(kPlace_hz, 1);
  add_mode(kPlace_hz + 0.15, 1);  // a twentieth of the half-power width
  const FrfEstimate frf = measured();
  options_.residue_rank = 1;
  AdditiveModel start = problem_.model;
  start.submodels.pop_back();
  FitEvidence evidence;
  const FitResult fit = ranked_fit(frf, start, options_, evidence);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  const auto found = modes(fit);
  ASSERT_EQ(found.size(), 2U);
  expect_pair(*found[0], *found[1], 0.15, 0.03);
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("are distinguishable")));
}

TEST_F(CoincidentModes, AShapeThatIsNotWorthItsParametersIsTakenBack) {
  add_mode(80.0, 1);
  add_mode(kPlace_hz, 1);
  AdditiveModel start = problem_.model;
  start.submodels.push_back(start.submodels[1]);  // at 80 Hz twice
  options_.residue_rank = 1;
  FitEvidence evidence;
  const FitResult fit = ranked_fit(measured(), start, options_, evidence);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_EQ(modes(fit).size(), 2U);
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("one mode fewer at 80")));
}

TEST_F(CoincidentModes, ToFirstOrderTwoPlacesFollowFromTheNeighbourhoodOfOne) {
  add_mode(kPlace_hz, 1);
  add_mode(kPlace_hz + 0.06, 1);
  test::measure(problem_);
  const FrfEstimate frf = test::frf_of(problem_);
  TiedModel tied{problem_.model, {0, 2}};
  tied.model.submodels.pop_back();
  options_.weighting = Weighting::relative;
  const std::optional<TiedModel> apart = with_parted(frf, tied, 1, options_);
  ASSERT_TRUE(apart.has_value());
  expect_pair(apart->model.submodels[1], apart->model.submodels[2], 0.06, 0.006);
  for (const std::size_t i : {1U, 2U}) EXPECT_LT(second_share(apart->model.submodels[i]), 1e-9);
}

}  // namespace stageid::test_ranked_fit
