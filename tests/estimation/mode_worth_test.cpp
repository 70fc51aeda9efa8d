#include "estimation/mode_worth.hpp"

#include <gtest/gtest.h>

#include "estimation/fit_additive_model.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid {
namespace {

struct Placed {
  test::DenseProblem problem = test::noisy_stage(HoldModel::none, 1e-2);
  FrfEstimate frf = test::frf_of(problem);
  ModelStructure structure;
  FitOptions options;
  AdditiveModel model = test::moved(problem.model, 1.0, 1.0);
  Placed() {
    options.weighting = Weighting::user;
    options.user_weights = problem.W;
    options.uncertainty = false;
    // Two modes that the stage does not have.
    for (const double hz : {500.0, 1300.0}) {
      Submodel nothing = model.submodels.back();
      const std::vector<double> a = test::mode_coefficients(hz, 0.01);
      nothing.denominator = {1.0, a[0], a[1]};
      model.submodels.push_back(nothing);
    }
  }
  FitResult fit(int iterations) {
    options.max_iterations = iterations;
    return fit_additive_model(frf, model, options);
  }
};

TEST(ModeWorth, ModesThatNoiseHidesStayWhereTheyAre) {
  Placed placed;
  const AdditiveModel before = placed.model;
  const ModeWorth worth(placed.frf, placed.structure, placed.problem.W);
  EXPECT_EQ(worth.hold_hidden(placed.fit(0), placed.model), 2);
  for (std::size_t i = 0; i < before.submodels.size(); ++i) {
    EXPECT_EQ(placed.model.submodels[i].frequency_held, i >= 4) << i;
    EXPECT_EQ(placed.model.submodels[i].damping_held, i >= 4) << i;
  }
  const FitResult fit = placed.fit(50);
  EXPECT_TRUE(fit.trustworthy()) << fit.message;
  for (std::size_t i = 1; i < before.submodels.size(); ++i) {
    const bool stayed = fit.model.submodels[i].denominator == before.submodels[i].denominator;
    EXPECT_EQ(stayed, i >= 4) << i;
  }
}

// With 95 % of what is nothing held, of many at most one in ten is not.
TEST(ModeWorth, HoldsNearlyAllOfWhatIsNothing) {
  int held = 0;
  int all = 0;
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    Placed placed;
    placed.problem = test::noisy_stage(HoldModel::none, 1e-2, seed);
    placed.frf = test::frf_of(placed.problem);
    placed.options.user_weights = placed.problem.W;
    for (std::size_t i = 1; i < 4; ++i)
      placed.model.submodels[i].denominator = placed.problem.model.submodels[i].denominator;
    for (int more = 0; more < 3; ++more) {
      const std::vector<double> a = test::mode_coefficients(1000.0 + 70.0 * more, 0.01);
      placed.model.submodels.push_back(placed.model.submodels.back());
      placed.model.submodels.back().denominator = {1.0, a[0], a[1]};
    }
    const ModeWorth worth(placed.frf, placed.structure, placed.problem.W);
    held += worth.hold_hidden(placed.fit(0), placed.model);
    all += 5;
  }
  EXPECT_GE(held, all * 9 / 10 - 2);
  EXPECT_LT(held, all + 1);
}

}  // namespace
}  // namespace stageid
