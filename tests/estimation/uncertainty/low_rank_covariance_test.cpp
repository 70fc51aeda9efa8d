// The uncertainty reported by fits with diagonal weights, with residues of given rank or free, compared with repeated
// measurements with correlated disturbances of the channels.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/repeated_fits.hpp"

namespace stageid::test_low_rank_covariance {

using test::RankOneStage;

/// The reported deviations of all quantities.
Eigen::ArrayXd deviations(const FitResult& fit) { return test::model_quantities(fit).deviation; }

test::RepeatedFits repeat(const RankOneStage& stage, const FitOptions& options) {
  return test::repeat_fits(stage.problem, options,
                           [&](std::uint64_t run) { return stage.measured_with(3000 + run); });
}

FitOptions low_rank(Weighting weighting, int residue_rank = 1) {
  FitOptions options = test::options_with(weighting);
  options.residue_rank = residue_rank;
  return options;
}

void expect_honest(const test::RepeatedFits& fits) {
  test::expect_honest(fits.scatter, fits.reported);
  EXPECT_NEAR(fits.mean_response_ratio(), 1.0, 4.0 * fits.response_ratio_error());
}

TEST(LowRankCovarianceMonteCarlo, CountsTheCorrelationOfOutputsAndInputs) {
  const RankOneStage stage;
  for (const int rank : {1, 0}) {
    SCOPED_TRACE(rank);
    const FitOptions options = low_rank(Weighting::noise_variance, rank);
    const test::RepeatedFits fits = repeat(stage, options);
    expect_honest(fits);
    FrfEstimate frf = stage.measured_with(3000);
    frf.residual_covariance.resize(0, 0);
    const Eigen::ArrayXd without =
        deviations(fit_additive_model(frf, stage.problem.model, options));
    const Eigen::ArrayXd ratio = (fits.scatter / without.square()).head(6);
    EXPECT_TRUE(ratio.minCoeff() < test::kLowestRatio || ratio.maxCoeff() > test::kHighestRatio)
        << "a correlation that changes nothing tests nothing";
  }
}

// Outputs with different noise, which is in the variances but not in unit weights. (Relative weights would follow the
// noise where the response is below it.)
TEST(LowRankCovarianceMonteCarlo, OtherWeightsWithKnownVarianceAreSandwiched) {
  expect_honest(repeat(RankOneStage(), low_rank(Weighting::unit)));
}

TEST(LowRankCovariance, OfOtherWeightsWithoutCorrelationUsesTheKnownVariance) {
  const RankOneStage stage;
  FrfEstimate frf = stage.measured_with(9);
  frf.residual_covariance.resize(0, 0);
  const FitOptions options = low_rank(Weighting::relative);
  const FitResult once = fit_additive_model(frf, stage.problem.model, options);
  frf.noise_variance *= 4.0;  // the weights and with them the estimate stay
  const FitResult four = fit_additive_model(frf, stage.problem.model, options);
  const Eigen::ArrayXd ratio = deviations(four) / deviations(once);
  EXPECT_NEAR(ratio.minCoeff(), 2.0, 1e-9);
  EXPECT_NEAR(ratio.maxCoeff(), 2.0, 1e-9);
}

// Springs far below the lines, which hardly differ there: the variances of each are of no use, that of the response is. It
// was negative.
TEST(LowRankCovariance, OfTheResponseIsRightWhereModesImitateEachOther) {
  RankOneStage stage;
  AdditiveModel& model = stage.problem.model;
  std::erase_if(model.submodels, [](const Submodel& s) { return !s.is_mode(); });
  for (const double part : {1e-3, 2e-3, 4e-3}) {
    Submodel spring = model.submodels.front();
    const double hz = part * stage.problem.frequency_hz[0];
    const double omega_rad_s = 2.0 * std::numbers::pi * hz;
    spring.denominator = {1.0, 0.1 / omega_rad_s, 1.0 / (omega_rad_s * omega_rad_s)};
    spring.held = HeldPole::pole;
    model.submodels.push_back(spring);
  }
  test::measure(stage.problem);
  const FitOptions options = low_rank(Weighting::noise_variance);
  constexpr int kFits = 100;
  double ratio = 0.0;
  for (int run = 0; run < kFits; ++run) {
    const FrfEstimate frf = stage.measured_with(static_cast<std::uint64_t>(700 + run));
    const FitResult fit = fit_additive_model(frf, model, options);
    ASSERT_EQ(fit.response_variance.rows(), frf.response.rows()) << fit.message();
    EXPECT_GT(fit.response_variance.minCoeff(), 0.0);
    const Eigen::MatrixXcd error =
        test::reference_response(fit.model, stage.problem.frequency_hz, stage.problem.hold) -
        stage.problem.G;
    ratio += error.cwiseAbs2().cwiseQuotient(fit.response_variance).leftCols(10).mean() / kFits;
  }
  EXPECT_NEAR(ratio, 1.0, 0.3);  // three standard errors
}

}  // namespace stageid::test_low_rank_covariance
