#include "estimation/modes_above_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimation/fit_additive_model.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid {
namespace {

/// The noisy stage: three modes in `problem.model`, behind a rigid body.
struct Placed {
  explicit Placed(std::uint64_t seed) : problem(test::noisy_stage(HoldModel::none, 1e-2, seed)) {
    options.weighting = Weighting::user;
    options.user_weights = problem.W;
    options.uncertainty = false;
    for (std::size_t i = 1; i < model.submodels.size(); ++i)
      model.submodels[i].denominator = problem.model.submodels[i].denominator;
  }
  void add(double hz) {
    const std::vector<double> a = test::mode_coefficients(hz, 0.01);
    model.submodels.push_back(model.submodels.back());
    model.submodels.back().denominator = {1.0, a[0], a[1]};
  }
  AdditiveModel above_noise(int wanted) {
    FitOptions still = options;
    still.max_iterations = 0;
    return modes_above_noise(frf, structure, fit_additive_model(frf, model, still), options, wanted,
                             decisions);
  }

  test::DenseProblem problem;
  FrfEstimate frf = test::frf_of(problem);
  ModelStructure structure;
  FitOptions options;
  AdditiveModel model = test::moved(problem.model, 1.0, 1.0);
  std::vector<std::string> decisions;
};

TEST(ModesAboveNoise, KeepsWhatIsThereAndHoldsWhatIsNot) {
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Placed placed(seed);
    for (const double hz : {500.0, 1000.0, 1070.0, 1140.0, 1300.0}) placed.add(hz);
    const AdditiveModel model = placed.above_noise(8);
    ASSERT_EQ(count_modes(model), 8);
    for (const Submodel& s : model.submodels) {
      if (!s.frequency_held) continue;
      EXPECT_TRUE(s.damping_held);
      EXPECT_TRUE(std::any_of(
          placed.model.submodels.begin() + 4, placed.model.submodels.end(),
          [&](const Submodel& nothing) { return nothing.denominator == s.denominator; }))
          << "held, but not where it was placed";
      ++held;
    }
    for (std::size_t i = 1; i < 4; ++i) {
      const double f = placed.problem.model.submodels[i].natural_frequency_hz();
      EXPECT_TRUE(std::any_of(model.submodels.begin(), model.submodels.end(), [&](const auto& s) {
        return s.is_mode() && !s.frequency_held &&
               std::abs(s.natural_frequency_hz() / f - 1.0) < 1e-3;
      })) << f;
    }
  }
  EXPECT_GE(held, 40) << "of 50 that are nothing; a search finds one in all that noise made";
}

// A weak mode with a residue of rank one that was placed elsewhere is not above the noise there, and is
// found where it is.
TEST(ModesAboveNoise, FindsAWeakModeThatWasPlacedElsewhere) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Placed placed(seed);
    const std::vector<double> a = test::mode_coefficients(500.0, 0.01);
    Submodel weak = placed.problem.model.submodels.back();
    weak.denominator = {1.0, a[0], a[1]};
    // At its resonance half of the other modes' response there.
    const Eigen::MatrixXcd G =
        response(placed.problem.model, Eigen::VectorXd::Constant(1, 500.0), HoldModel::none);
    const double size = 0.5 * 0.02 * G.cwiseAbs().minCoeff();
    const double output[] = {1.0, -0.8};
    const double input[] = {1.0, 0.7, -0.9};
    for (Eigen::Index i = 0; i < 2; ++i)
      for (Eigen::Index j = 0; j < 3; ++j) weak.numerator[0](i, j) = size * output[i] * input[j];
    AdditiveModel alone = placed.problem.model;
    alone.submodels = {weak};
    placed.frf.response += response(alone, placed.problem.frequency_hz, HoldModel::none);
    placed.add(620.0);
    const AdditiveModel model = placed.above_noise(4);
    EXPECT_EQ(placed.decisions.size(), 1U);
    found += std::any_of(model.submodels.begin(), model.submodels.end(), [](const Submodel& s) {
      return s.is_mode() && !s.frequency_held && std::abs(s.natural_frequency_hz() - 500.0) < 2.0;
    });
  }
  EXPECT_GE(found, 9);
}

// Held poles are no unknowns: the fit leaves them, to the last bit, and finds the others as if they were known.
TEST(ModesAboveNoise, AFitLeavesHeldPolesWhereTheyAre) {
  Placed placed(1);
  placed.add(500.0);
  placed.add(1300.0);
  for (std::size_t i = 4; i < 6; ++i)
    placed.model.submodels[i].frequency_held = placed.model.submodels[i].damping_held = true;
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn}) {
    placed.options.method = method;
    AdditiveModel start = placed.model;
    for (std::size_t i = 1; i < 4; ++i) start.submodels[i].denominator[1] *= 1.1;
    const FitResult fit = fit_additive_model(placed.frf, start, placed.options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message;
    for (std::size_t i = 1; i < 6; ++i)
      EXPECT_EQ(fit.model.submodels[i].denominator == start.submodels[i].denominator, i >= 4) << i;
  }
}

}  // namespace
}  // namespace stageid
