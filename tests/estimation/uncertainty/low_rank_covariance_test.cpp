// The uncertainty reported by fits with diagonal weights, with residues of given rank or free, compared with repeated
// measurements with correlated disturbances of the channels.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/search/fit_additive_model.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/delayed_fit_options.hpp"

namespace stageid {
namespace test_low_rank_covariance {

constexpr int kRuns = 150;
// chi^2 of 149 degrees of freedom over its mean lies in here with 99.99 %.
constexpr double kLowest = 0.62;
constexpr double kHighest = 1.52;

/// The 2 x 3 stage with modes of rank one, one disturbance on both outputs, and inputs that repeat what
/// the controller makes of it.
struct RankOneStage {
  test::DenseProblem problem = test::noisy_stage(HoldModel::exact, 0.0);
  test::CorrelatedNoise noise;

  RankOneStage() {
    test::RandomNumbers random(12);
    for (Submodel& s : problem.model.submodels) {
      if (!s.is_mode()) continue;
      const Eigen::VectorXd phi{{random.uniform(0.5, 1.5), random.uniform(0.5, 1.5)}};
      const Eigen::VectorXd psi{{random.normal(), random.normal(), random.normal()}};
      s.numerator[0] = s.denominator[2] * phi * psi.transpose();
    }
    problem.G = test::reference_response(problem.model, problem.frequency_hz, problem.hold);
    noise = test::correlated_noise(problem, 0.01, 0.9);
  }
};

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
  return Eigen::Map<const Eigen::VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
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
    test::RandomNumbers random(static_cast<std::uint64_t>(3000 + run));
    FrfEstimate frf = test::measured(stage.problem, stage.noise, random);
    const FitResult fit = fit_additive_model(frf, stage.problem.model, options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message;
    const Eigen::VectorXd value = quantities(fit.model, false);
    if (run == 0) {
      values.resize(value.size(), kRuns);
      out.reported.setZero(value.size());
      frf.residual_covariance_re.resize(0, 0);
      frf.residual_covariance_im.resize(0, 0);
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
  out.scatter = (values.colwise() - values.rowwise().mean()).rowwise().squaredNorm() / (kRuns - 1);
  out.response_ratio = response_ratio.mean();
  out.response_ratio_error =
      std::sqrt((response_ratio - response_ratio.mean()).square().sum() / (kRuns - 1) / kRuns);
  return out;
}

void expect_honest(const Repeated& repeated) {
  const Eigen::ArrayXd ratio = repeated.scatter / repeated.reported;
  EXPECT_GT(ratio.minCoeff(), kLowest);
  EXPECT_LT(ratio.maxCoeff(), kHighest);
  EXPECT_NEAR(repeated.response_ratio, 1.0, 4.0 * repeated.response_ratio_error);
}

void expect_the_correlation_to_matter(const Repeated& repeated) {
  const Eigen::ArrayXd ratio = (repeated.scatter / repeated.without).head(6);
  EXPECT_TRUE(ratio.minCoeff() < kLowest || ratio.maxCoeff() > kHighest)
      << "a correlation that changes nothing tests nothing";
}

TEST(LowRankCovarianceMonteCarlo, CountsTheCorrelationOfOutputsAndInputs) {
  const Repeated repeated = repeat(Weighting::noise_variance);
  expect_honest(repeated);
  expect_the_correlation_to_matter(repeated);
}

TEST(CovarianceMonteCarlo, FreeResiduesCountTheCorrelationOfOutputsAndInputs) {
  const Repeated repeated = repeat(Weighting::noise_variance, 0);
  expect_honest(repeated);
  expect_the_correlation_to_matter(repeated);
}

// Outputs with different noise, which is in the variances but not in unit weights. (Relative weights would follow the
// noise where the response is below it.)
TEST(LowRankCovarianceMonteCarlo, OtherWeightsWithKnownVarianceAreSandwiched) {
  expect_honest(repeat(Weighting::unit));
}

TEST(LowRankCovariance, OfOtherWeightsWithoutCorrelationUsesTheKnownVariance) {
  const RankOneStage stage;
  test::RandomNumbers random(9);
  FrfEstimate frf = test::measured(stage.problem, stage.noise, random);
  frf.residual_covariance_re.resize(0, 0);
  frf.residual_covariance_im.resize(0, 0);
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

}  // namespace test_low_rank_covariance
}  // namespace stageid
