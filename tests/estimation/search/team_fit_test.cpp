#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <utility>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/search/automatic_fit.hpp"
#include "estimation/search/structured_fit.hpp"
#include "tests/support/models/divided_frf.hpp"
#include "tests/support/models/expect_same_fit.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/thread_team.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_team_fit {

using test::divided;
using test::run_team;

/// More channels than two tiles, of two inputs.
const test::RandomStage& wide_stage() {
  static const test::RandomStage stage = test::draw_random_stage(
      3, {.outputs = 300, .inputs = 2, .least_modes = 4, .most_modes = 4, .line_spacing_hz = 8.0});
  return stage;
}

FitOptions options_of(const test::RandomStage& stage) {
  FitOptions options = test::fit_options(Weighting::noise_variance, HoldModel::exact,
                                         DelayModel::estimate, stage.delay_s);
  options.threads = 1;
  return options;
}

TEST(TeamFit, AFitHasTheSameBytesInEveryTeam) {
  const test::RandomStage& stage = wide_stage();
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn, FitMethod::sk}) {
    FitOptions options = options_of(stage);
    options.method = method;
    const FitResult alone = fit_additive_model(stage.frf, stage.truth, options);
    for (const int size : {2, 3, 4, 8})  // with 4 and 8, processes have no tile
      run_team(size, [&](const Team& team) {
        FitOptions shared = options;
        shared.team = &team;
        test::expect_same(fit_additive_model(divided(stage.frf, team), stage.truth, shared), alone);
      });
  }
}

TEST(TeamFit, ASearchHasTheSameBytesInEveryTeam) {
  const test::RandomStage& stage = wide_stage();
  const ModelStructure structure{.rigid_body = true};
  const ModeSelection search;
  const FitOptions options = options_of(stage);
  const FitResult alone = automatic_fit(stage.frf, structure, search, options);
  for (const int size : {2, 4})
    run_team(size, [&](const Team& team) {
      FitOptions shared = options;
      shared.team = &team;
      test::expect_same(automatic_fit(divided(stage.frf, team), structure, search, shared), alone);
    });
}

/// Weights from every source, deviations of shapes, advice for what the model misses, and lines that are alike.
TEST(TeamFit, TheWholeWayHasTheSameBytesInEveryTeam) {
  const test::RandomStage& stage = wide_stage();
  FrfEstimate distorted = stage.frf;
  distorted.total_variance = 1.2 * distorted.noise_variance;
  distorted.total_dof = 3.0;
  distorted.noise_dof = 5.0;
  FrfEstimate bare = stage.frf;
  bare.noise_variance.resize(0, 0);
  FrfEstimate disturbed = stage.frf;
  disturbed.response.row(400).array() += 0.1 * disturbed.response.cwiseAbs().maxCoeff();
  for (const auto& [frf, weighting] : {std::pair{&stage.frf, Weighting::noise_variance},
                                       {&distorted, Weighting::total_variance},
                                       {&bare, Weighting::relative},
                                       {&disturbed, Weighting::noise_variance},
                                       {&stage.frf, Weighting::unit}}) {
    FitOptions options = options_of(stage);
    options.weighting = weighting;
    RequestedStructure structure;
    structure.common.general_damping = weighting == Weighting::total_variance;
    ModeSelection selection;
    selection.exactly = weighting == Weighting::unit ? 3 : 0;
    for (const Submodel& s : stage.truth.submodels)
      if (s.is_mode() && selection.exactly == 0)
        selection.modes.push_back({s.natural_frequency_hz(), s.damping_ratio(), 1});
    selection.keep_modes = selection.exactly == 0;
    const FitResult alone = structured_fit(*frf, structure, selection, options);
    run_team(3, [&, whole = frf](const Team& team) {
      FitOptions shared = options;
      shared.team = &team;
      const FitResult fit = structured_fit(divided(*whole, team), structure, selection, shared);
      test::expect_same(fit, alone);
      EXPECT_EQ(fit.message(), alone.message());
      EXPECT_EQ(fit.findings, alone.findings);
    });
  }
}

TEST(TeamFit, AnIterationSendsTheEquationsOfThePoles) {
  const test::RandomStage& stage = wide_stage();
  FitOptions options = options_of(stage);
  options.method = FitMethod::gn;
  options.uncertainty = false;
  const FitResult alone = fit_additive_model(stage.frf, stage.truth, options);
  const auto iterations = static_cast<Eigen::Index>(alone.cost.size()) - 1;
  Eigen::Index unknowns = 1;  // the delay
  for (const Submodel& s : stage.truth.submodels) unknowns += s.order();
  const auto submodels = std::ssize(stage.truth.submodels);
  constexpr Eigen::Index kOfNumerators = 4;
  constexpr Eigen::Index kOfTheEnd = 4;  // power of the data, relative error
  const Eigen::Index sums =
      (iterations + 1) * (ArrowSystem::sums_size(unknowns) + kOfNumerators) + kOfTheEnd + submodels;
  const Eigen::Index numerators = submodels * stage.frf.response.rows();
  for (const int size : {2, 3}) {
    std::atomic<std::uint64_t> bytes = 0;
    run_team(size, [&](const Team& team) {
      FitOptions shared = options;
      shared.team = &team;
      fit_additive_model(divided(stage.frf, team), stage.truth, shared);
      bytes += team.traffic().bytes;
    });
    const auto formula = static_cast<double>((size - 1) * 8 * (2 * sums + numerators));
    EXPECT_NEAR(static_cast<double>(bytes), formula, 0.05 * formula) << iterations;
  }
}

}  // namespace stageid::test_team_fit
