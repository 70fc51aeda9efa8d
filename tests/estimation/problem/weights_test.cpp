#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "estimation/problem/fit_problem.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_weights {

FrfEstimate small_frf() {
  test::DenseProblem problem;
  problem.model = test::named_model(2, 2);
  problem.frequency_hz = Eigen::VectorXd{{10.0, 20.0, 40.0}};
  problem.G.resize(4, 3);
  problem.G << std::complex<double>(3.0, 4.0), 2.0, 1.0,  //
      std::complex<double>(0.0, -2.0), 4.0, 0.5,          //
      std::complex<double>(1e-9, 0.0), 8.0, 0.25,         //
      std::complex<double>(-6.0, 8.0), 16.0, 0.125;
  return test::frf_of(problem);
}

Eigen::MatrixXd weights(const FrfEstimate& frf, Weighting weighting) {
  FitOptions options = test::fit_options(weighting);
  return make_weights(frf, options);
}

TEST(Weights, AreOneOrOfTheMagnitudeAsThePapersOrItsSquare) {
  const FrfEstimate frf = small_frf();
  const Eigen::MatrixXd inverse = weights(frf, Weighting::inverse_magnitude);
  const Eigen::MatrixXd relative = weights(frf, Weighting::relative);
  EXPECT_NEAR(inverse(0, 0), 1.0 / 5.0, 1e-16);
  EXPECT_NEAR(relative(0, 0), 1.0 / 25.0, 1e-16);
  EXPECT_NEAR(inverse(3, 0), 1.0 / 10.0, 1e-16);
  EXPECT_NEAR(relative(2, 0), 1e18, 1e4);
  EXPECT_NEAR(relative(3, 2), 64.0, 1e-13);
  EXPECT_EQ(weights(small_frf(), Weighting::unit), Eigen::MatrixXd::Ones(4, 3));
}

TEST(Weights, VariancesThatAreExactOrUnknownInOriginAreInverted) {
  FrfEstimate frf = small_frf();
  frf.noise_variance = Eigen::MatrixXd::Constant(4, 3, 0.25);
  frf.noise_variance(1, 2) = 0.04;
  frf.total_variance = 2.0 * frf.noise_variance;
  frf.noise_dof = 0.0;
  const Eigen::MatrixXd noise = weights(frf, Weighting::noise_variance);
  EXPECT_EQ(noise(0, 0), 4.0);
  EXPECT_EQ(noise(1, 2), 25.0);
  EXPECT_EQ(weights(frf, Weighting::total_variance)(1, 2), 12.5);
}

TEST(Weights, ManyDegreesOfFreedomAreNotSmoothed) {
  FrfEstimate frf = small_frf();
  frf.noise_variance = frf.response.cwiseAbs();
  frf.noise_dof = 1170.0;
  const Eigen::MatrixXd expected = frf.noise_variance.cwiseInverse() * (1169.0 / 1170.0);
  EXPECT_LT((weights(frf, Weighting::noise_variance) - expected).cwiseAbs().maxCoeff(),
            1e-15 * expected.maxCoeff());
}

TEST(Weights, UsersAreTakenAsTheyAre) {
  FitOptions options = test::fit_options(Weighting::user);
  Eigen::MatrixXd given = Eigen::MatrixXd::Constant(4, 3, 0.5);
  given(2, 1) = 0.0;  // leaves a point out
  options.user_weights = given;
  EXPECT_EQ(*make_weights(small_frf(), options), given);
  EXPECT_EQ(&*make_weights(small_frf(), options), &*options.user_weights);  // and no copy of them
}

// Variances with few degrees of freedom: E{1/variance} is infinite for one. After smoothing, the inverse must be right
// within a few per cent, and so must W v W, the effect of the scatter of the weights on an estimate, although v and W
// are from the same sample.
TEST(Weights, InversesOfSmoothedVariancesAreUnbiasedAndTheirScatterIsCounted) {
  constexpr Eigen::Index kChannels = 40;
  constexpr Eigen::Index kLines = 400;
  for (const double dof : {1.0, 2.0, 3.0, 9.0, 26.0, 52.0}) {
    test::RandomNumbers random(static_cast<std::uint64_t>(dof) + 100);
    FrfEstimate frf;
    for (Eigen::Index c = 0; c < kChannels; ++c) frf.outputs.names.push_back("z");
    frf.inputs.names = {"a"};
    frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 400.0);
    Eigen::MatrixXd truth(kChannels, kLines);
    frf.noise_variance.resize(kChannels, kLines);
    for (Eigen::Index k = 0; k < kLines; ++k)
      for (Eigen::Index c = 0; c < kChannels; ++c) {
        truth(c, k) = (1.0 + static_cast<double>(c)) * std::exp(-0.002 * static_cast<double>(k));
        frf.noise_variance(c, k) = truth(c, k) * random.chi_square_mean(dof);
      }
    frf.noise_dof = dof;
    const Eigen::ArrayXXd variance =
        test::values(weighed_variance(frf, Weighting::noise_variance)).cwiseQuotient(truth).array();
    const Eigen::ArrayXXd weight =
        weights(frf, Weighting::noise_variance).cwiseProduct(truth).array();
    // 16 000 values of relative scatter below 1/4, correlated over up to 25 lines.
    const double scatter = 4.0 * 0.25 * std::sqrt(25.0 / 16000.0);
    // The variance itself has as few degrees as it had; its mean over all is as certain.
    const double wanted = weight.square().mean();
    EXPECT_NEAR((weight.square() * variance).mean(), wanted, 0.03 + 4.0 / std::sqrt(16000.0 * dof))
        << dof;
    EXPECT_NEAR(weight.mean(), 1.0, 0.03 + 0.5 * scatter) << dof;
    // And they do not scatter as those they are made of: 25 degrees give 1/5.
    EXPECT_LT(std::sqrt((weight - weight.mean()).square().mean()), 0.26) << dof;
  }
}

// Var(G_ij) = C_E,ii [(U U^H)^-1]_jj: the factor of the inputs is known exactly on every line and is not smoothed.
TEST(Weights, OnlyTheRandomFactorIsSmoothed) {
  constexpr Eigen::Index kLines = 300;
  test::RandomNumbers random(8);
  FrfEstimate frf;
  frf.outputs.names = {"z1", "z2"};
  frf.inputs.names = {"a1", "a2", "a3"};
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 300.0);
  frf.noise_dof = 2.0;
  frf.noise_variance.resize(6, kLines);
  frf.residual_covariance = Eigen::MatrixXcd::Zero(4, kLines);
  Eigen::MatrixXd truth(6, kLines);
  for (Eigen::Index k = 0; k < kLines; ++k)
    for (Eigen::Index y = 0; y < 2; ++y) {
      const double noise = 1.0 + static_cast<double>(y);
      const double estimated = noise * random.chi_square_mean(2.0);
      frf.residual_covariance(y * 3, k) = estimated;
      for (Eigen::Index u = 0; u < 3; ++u) {
        const double inputs = k % 7 == 0 ? 50.0 : 1.0;  // comb-like: smoothing would smear it
        truth(y + 2 * u, k) = noise * inputs;
        frf.noise_variance(y + 2 * u, k) = estimated * inputs;
      }
    }
  const Eigen::ArrayXXd ratio = weights(frf, Weighting::noise_variance).cwiseProduct(truth).array();
  EXPECT_NEAR(ratio.mean(), 1.0, 0.06);
  EXPECT_LT(ratio.maxCoeff(), 2.5);
  EXPECT_GT(ratio.minCoeff(), 0.4);
}

struct WeightRefusal : testing::Test {
  void expect_refused(const std::string& part) {
    EXPECT_THAT(
        test::error_message<std::invalid_argument>([this] { make_weights(frf_, options_); }),
        testing::HasSubstr(part));
  }
  FrfEstimate frf_ = small_frf();
  FitOptions options_;
};

TEST_F(WeightRefusal, VariancesThatAreMissing) {
  options_.weighting = Weighting::noise_variance;
  expect_refused("noise_variance in the FRF");
  options_.weighting = Weighting::total_variance;
  expect_refused("total_variance in the FRF");
}

TEST_F(WeightRefusal, VariancesThatAreZeroOrNotFinite) {
  options_.weighting = Weighting::noise_variance;
  for (const double wrong : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    frf_.noise_variance = Eigen::MatrixXd::Ones(4, 3);
    frf_.noise_variance(2, 1) = wrong;
    expect_refused("z1 <- a2 at 20");
  }
}

TEST_F(WeightRefusal, AResponseOfZeroHasNoRelativeError) {
  frf_.response(3, 2) = 0.0;
  for (const Weighting weighting : {Weighting::inverse_magnitude, Weighting::relative}) {
    options_.weighting = weighting;
    expect_refused("z2 <- a2 at 40");
  }
}

TEST_F(WeightRefusal, UsersWeightsOfAnotherShapeOrThatAreNone) {
  options_.weighting = Weighting::user;
  expect_refused("shape");
  options_.user_weights = Eigen::MatrixXd(Eigen::MatrixXd::Ones(3, 4));
  expect_refused("shape");
  for (const auto& [wrong, reason] :
       {std::pair{-1.0, "negative"}, std::pair{std::nan(""), "finite"},
        std::pair{HUGE_VAL, "finite"}}) {
    Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(4, 3);
    weights(0, 0) = wrong;
    options_.user_weights = weights;
    expect_refused(reason);
  }
  options_.user_weights = Eigen::MatrixXd(Eigen::MatrixXd::Zero(4, 3));
  expect_refused("one positive");
}

}  // namespace stageid::test_weights
