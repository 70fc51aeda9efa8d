// Modes that noise hides: which are, what becomes of their poles, and what shrinking their numerators is worth.

#include "estimation/fit/hidden_modes.hpp"

#include <gtest/gtest.h>

#include "estimation/fit/fit_additive_model.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_hidden_modes {

constexpr double kNoise = 1e-2;

/// The noisy stage: three modes where they are, and others where nothing is.
struct Placed {
  Placed(std::uint64_t seed, std::initializer_list<double> nothing_hz)
      : problem(test::noisy_stage(HoldModel::none, kNoise, seed)) {
    options.weighting = Weighting::user;
    options.user_weights = problem.W;
    options.uncertainty = false;
    for (const double hz : nothing_hz) {
      const std::vector<double> a = test::mode_coefficients(hz, 0.01);
      model.submodels.push_back(model.submodels.back());
      model.submodels.back().denominator = {1.0, a[0], a[1]};
    }
  }
  FitResult fit_numerators() {
    options.max_iterations = 0;
    return fit_additive_model(frf, model, options);
  }
  void hold_from(std::size_t first) {
    for (std::size_t i = first; i < model.submodels.size(); ++i)
      model.submodels[i].held = HeldPole::pole;
  }
  /// sum W |P - truth|^2
  double squared_error(const AdditiveModel& fitted) const {
    const Eigen::MatrixXcd truth =
        test::reference_response(problem.model, problem.frequency_hz, problem.hold);
    const Eigen::MatrixXcd P = response(fitted, problem.frequency_hz, problem.hold);
    return (problem.W.array() * (P - truth).array().abs2()).sum();
  }

  test::DenseProblem problem;
  FrfEstimate frf = test::frf_of(problem);
  FitOptions options;
  AdditiveModel model = test::moved(problem.model, 1.0, 1.0);
};

TEST(HiddenModes, OnlyWhatIsNotThereIsHeld) {
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Placed placed(seed, {500.0, 1000.0, 1070.0, 1140.0, 1300.0});
    FitResult fit = placed.fit_numerators();
    const int hidden = hold_hidden_modes(placed.frf, placed.options.user_weights, 1, fit);
    for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
      const Submodel& s = fit.model.submodels[i];
      EXPECT_TRUE(i >= 4 || s.held == HeldPole::none) << i;
    }
    held += hidden;
  }
  EXPECT_GE(held, 49) << "of 50; noise alone is above the threshold at one place of 400";
}

// Held poles are not unknowns: the fit does not change them, and finds the others as if they were known.
TEST(HiddenModes, AFitLeavesHeldPolesWhereTheyAre) {
  Placed placed(1, {500.0, 1300.0});
  placed.hold_from(4);
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn}) {
    placed.options.method = method;
    AdditiveModel start = placed.model;
    for (std::size_t i = 1; i < 4; ++i) start.submodels[i].denominator[1] *= 1.1;
    const FitResult fit = fit_additive_model(placed.frf, start, placed.options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    for (std::size_t i = 1; i < 6; ++i)
      EXPECT_EQ(fit.model.submodels[i].denominator == start.submodels[i].denominator, i >= 4) << i;
  }
}

// Alone, a hidden mode keeps 1 - s of its numerators; the recorded cost is that of the returned model.
TEST(HiddenModes, OneHiddenModeKeepsItsPart) {
  Placed placed(3, {500.0});
  placed.hold_from(4);
  const FitResult before = placed.fit_numerators();
  placed.options.shrink_hidden = true;
  const FitResult after = placed.fit_numerators();
  const double lines = static_cast<double>(placed.frf.lines());
  const double numbers = 6.0;
  const double unknowns = 5.0 * numbers + 6.0;  // held poles are not free, but known to be small
  const double noise = 2.0 * lines * before.model.fit.cost / (2.0 * lines * numbers - unknowns);
  const double kept = 1.0 - 0.5 * (numbers - 2.0) * noise / before.removal_cost[4];
  for (Eigen::Index i = 0; i < 2; ++i)
    for (Eigen::Index j = 0; j < 3; ++j)
      EXPECT_NEAR(after.model.submodels[4].numerator[0](i, j) /
                      before.model.submodels[4].numerator[0](i, j),
                  kept, 1e-3 * kept);
  const Eigen::MatrixXcd E =
      placed.problem.G - response(after.model, placed.problem.frequency_hz, placed.problem.hold);
  const double cost = (placed.problem.W.array() * E.array().abs2()).sum() / (2.0 * lines);
  EXPECT_NEAR(after.model.fit.cost, cost, 1e-9 * cost);
  EXPECT_GT(cost, before.model.fit.cost);
  EXPECT_EQ(after.decisions.size(), 1U);
}

// James and Stein's risk where the truth is zero: of d sigma^2, (d - 2) (2 a - a^2) is saved; a = 1/2.
TEST(HiddenModes, ShrinkingSavesWhatTheorySays) {
  constexpr int kSeeds = 300;
  double saved = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Placed placed(seed, {500.0});
    placed.hold_from(4);
    const double plain = placed.squared_error(placed.fit_numerators().model);
    placed.options.shrink_hidden = true;
    saved += plain - placed.squared_error(placed.fit_numerators().model);
  }
  const double of_a_number = 0.5 * kNoise * kNoise;
  EXPECT_NEAR(saved / kSeeds / of_a_number, 0.75 * 4.0, 0.3);  // 0.1 by chance
}

// Shrinking solves for all numerators, which would then have any rank.
TEST(HiddenModes, ResiduesOfAGivenRankKeepIt) {
  Placed placed(3, {500.0});
  placed.hold_from(4);
  placed.options.residue_rank = 1;
  placed.options.shrink_hidden = true;
  const FitResult fit = fit_additive_model(placed.frf, placed.model, placed.options);
  for (const Submodel& s : fit.model.submodels) {
    if (!s.is_mode()) continue;
    const Eigen::VectorXd values = svd(s.numerator[0], 0).singularValues();
    EXPECT_LT(values[1], 1e-12 * values[0]);
  }
}

// A mode above the noise keeps its numerators if another one is hidden.
TEST(HiddenModes, WithoutAHiddenModeNothingChanges) {
  Placed placed(5, {});
  const FitResult before = placed.fit_numerators();
  placed.options.shrink_hidden = true;
  const FitResult after = placed.fit_numerators();
  EXPECT_EQ(before.model.fit.cost, after.model.fit.cost);
  EXPECT_TRUE(after.decisions.empty());
}

}  // namespace stageid::test_hidden_modes
