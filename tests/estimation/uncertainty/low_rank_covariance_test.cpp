// The uncertainty reported by fits with diagonal weights, with residues of given rank or free, compared with repeated
// measurements with correlated disturbances of the channels.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "estimation/search/fit_additive_model.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/delayed_fit_options.hpp"

namespace stageid::test_low_rank_covariance {

using test::kRuns;
using test::RankOneStage;

/// Frequencies, damping ratios, then all numerators.
Eigen::VectorXd quantities(const AdditiveModel& model, bool deviations) {
  std::vector<double> out;
  for (const Submodel& s : model.submodels)
    if (s.is_mode()) {
      out.push_back(deviations ? s.natural_frequency_std_hz.value() : s.natural_frequency_hz());
      out.push_back(deviations ? s.damping_ratio_std.value() : s.damping_ratio());
    }
  for (const Submodel& s : model.submodels) {
    const Eigen::MatrixXd& B = deviations ? s.numerator_std.at(0) : s.numerator[0];
    out.insert(out.end(), B.reshaped().begin(), B.reshaped().end());
  }
  return Eigen::Map<const Eigen::VectorXd>(out.data(), std::ssize(out));
}

struct Repeated {
  Eigen::ArrayXd scatter;             ///< variances
  Eigen::ArrayXd reported;            ///< mean of the reported ones
  Eigen::ArrayXd without;             ///< of a file without the correlation
  double response_ratio = 0.0;        ///< |error|^2 over its reported mean
  double response_ratio_error = 0.0;  ///< standard error of it
};

Repeated repeat(Weighting weighting, int residue_rank = 1) {
  const RankOneStage stage;
  FitOptions options = test::options_with(weighting);
  options.threads = 1;
  options.residue_rank = residue_rank;
  Repeated out;
  Eigen::MatrixXd values;
  Eigen::ArrayXd response_ratio(kRuns);
  for (int run = 0; run < kRuns; ++run) {
    FrfEstimate frf = stage.measured_with(static_cast<std::uint64_t>(3000 + run));
    const FitResult fit = fit_additive_model(frf, stage.problem.model, options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    const Eigen::VectorXd value = quantities(fit.model, false);
    if (run == 0) {
      values.resize(value.size(), kRuns);
      out.reported.setZero(value.size());
      frf.residual_covariance.resize(0, 0);
      out.without =
          quantities(fit_additive_model(frf, fit.model, options).model, true).array().square();
    }
    values.col(run) = value;
    out.reported += quantities(fit.model, true).array().square() / kRuns;
    const Eigen::MatrixXcd error =
        test::reference_response(fit.model, stage.problem.frequency_hz, stage.problem.hold) -
        stage.problem.G;
    response_ratio[run] = error.cwiseAbs2().cwiseQuotient(fit.response_variance).mean();
  }
  out.scatter = test::scatter_of(values);
  out.response_ratio = response_ratio.mean();
  out.response_ratio_error =
      std::sqrt((response_ratio - response_ratio.mean()).square().sum() / (kRuns - 1) / kRuns);
  return out;
}

void expect_honest(const Repeated& repeated) {
  test::expect_honest(repeated.scatter, repeated.reported);
  EXPECT_NEAR(repeated.response_ratio, 1.0, 4.0 * repeated.response_ratio_error);
}

TEST(LowRankCovarianceMonteCarlo, CountsTheCorrelationOfOutputsAndInputs) {
  for (const int rank : {1, 0}) {
    SCOPED_TRACE(rank);
    const Repeated repeated = repeat(Weighting::noise_variance, rank);
    expect_honest(repeated);
    const Eigen::ArrayXd ratio = (repeated.scatter / repeated.without).head(6);
    EXPECT_TRUE(ratio.minCoeff() < test::kLowestRatio || ratio.maxCoeff() > test::kHighestRatio)
        << "a correlation that changes nothing tests nothing";
  }
}

// Outputs with different noise, which is in the variances but not in unit weights. (Relative weights would follow the
// noise where the response is below it.)
TEST(LowRankCovarianceMonteCarlo, OtherWeightsWithKnownVarianceAreSandwiched) {
  expect_honest(repeat(Weighting::unit));
}

TEST(LowRankCovariance, OfOtherWeightsWithoutCorrelationUsesTheKnownVariance) {
  const RankOneStage stage;
  FrfEstimate frf = stage.measured_with(9);
  frf.residual_covariance.resize(0, 0);
  FitOptions options = test::options_with(Weighting::relative);
  options.residue_rank = 1;
  const FitResult once = fit_additive_model(frf, stage.problem.model, options);
  frf.noise_variance *= 4.0;  // the weights and with them the estimate stay
  const FitResult four = fit_additive_model(frf, stage.problem.model, options);
  const Eigen::ArrayXd ratio =
      quantities(four.model, true).array() / quantities(once.model, true).array();
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
  stage.problem.G = test::reference_response(model, stage.problem.frequency_hz, stage.problem.hold);
  FitOptions options = test::options_with(Weighting::noise_variance);
  options.residue_rank = 1;
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
