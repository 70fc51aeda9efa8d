#include "estimation/modal/residual_verdict.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test_residual_verdict {

using testing::HasSubstr;

constexpr Eigen::Index kOutputs = 2;
constexpr Eigen::Index kInputs = 3;

/// A response of noise about zero, so that the model to judge is zero; variances of `dof` degrees of freedom.
FrfEstimate noise(std::uint64_t seed, Eigen::Index lines, int dof) {
  test::RandomNumbers random(seed);
  FrfEstimate frf;
  const AdditiveModel model = test::named_model(kOutputs, kInputs);
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(lines, 1.0, static_cast<double>(lines));
  frf.response = test::circular_matrix(random, kOutputs * kInputs, lines);
  frf.noise_variance.setOnes(kOutputs * kInputs, lines);
  frf.noise_dof = dof;
  for (double& variance : frf.noise_variance.reshaped())
    if (dof > 0) variance = random.chi_square_mean(dof);
  return frf;
}

/// Of a model that is constant.
ResidualVerdict judge(const FrfEstimate& frf, double level = 0.0,
                      const Eigen::MatrixXd& weights = {}) {
  return judge_residual(
      frf,
      [&](const ResponseBlock& block) {
        return Eigen::MatrixXcd::Constant(block.channels, block.lines, level).eval();
      },
      weights, 1);
}

TEST(ResidualVerdict, NoiseIsExplainedHoweverFewDegreesOfFreedomItsVarianceHas) {
  for (const int dof : {0, 1, 2, 5, 50})
    for (std::uint64_t seed = 1; seed <= 200; ++seed)
      for (const Eigen::Index lines : {3, 40, 400}) {
        const ResidualVerdict verdict = judge(noise(seed, lines, dof));
        ASSERT_TRUE(verdict.explained)
            << dof << " degrees, seed " << seed << ", " << lines << " lines: " << verdict.reason;
      }
}

// The error of the model is as large as the noise, in power: that is where the line is drawn.
TEST(ResidualVerdict, TheLineIsAtTwiceTheNoise) {
  for (const int dof : {0, 1, 2, 5, 50}) {
    FrfEstimate frf = noise(7, 2000, dof);
    frf.response *= std::sqrt(1.8);
    EXPECT_TRUE(judge(frf).explained) << dof;
    frf.response *= std::sqrt(2.4 / 1.8);
    const ResidualVerdict verdict = judge(frf);
    EXPECT_FALSE(verdict.explained) << dof;
    EXPECT_THAT(verdict.reason, HasSubstr("times what noise explains"));
  }
}

TEST(ResidualVerdict, OneOutputOneInputOrOneModeThatIsMissedIsNamed) {
  const FrfEstimate sound = noise(11, 640, 20);
  FrfEstimate frf = sound;
  for (Eigen::Index c = 1; c < frf.response.rows(); c += kOutputs) frf.response.row(c) *= 3.0;
  EXPECT_THAT(judge(frf).reason, HasSubstr("output " + frf.outputs.names[1]));
  frf = sound;
  frf.response.middleRows(2 * kOutputs, kOutputs) *= 3.0;
  EXPECT_THAT(judge(frf).reason, HasSubstr("input " + frf.inputs.names[2]));
  frf = sound;
  frf.response.middleCols(100, 3) *= 30.0;  // of 640 lines
  EXPECT_THAT(judge(frf).reason, HasSubstr("97 to 128 Hz"));
}

TEST(ResidualVerdict, DistortionThatTheRealizationsShowIsKnown) {
  FrfEstimate frf = noise(13, 500, 50);
  frf.response *= 10.0;
  EXPECT_FALSE(judge(frf).explained);
  frf.total_variance = 100.0 * noise(14, 500, 2).noise_variance;
  frf.total_dof = 2.0;
  const ResidualVerdict verdict = judge(frf);
  EXPECT_TRUE(verdict.explained) << verdict.reason;
  EXPECT_EQ(verdict.variance, ResidualVariance::total);
  frf.response *= 2.0;
  EXPECT_FALSE(judge(frf).explained);
  frf.noise_variance.resize(0, 0);
  EXPECT_THAT(judge(frf).reason, HasSubstr("noise and distortion explain"));
}

// One realization: the lines scatter about a smooth response by noise and distortion.
TEST(ResidualVerdict, DistortionOfOneRealizationIsTheScatterOfItsLines) {
  FrfEstimate frf = noise(15, 500, 50);
  frf.response *= 10.0;  // noise variance 1
  frf.response.array() += 300.0;
  const ResidualVerdict right = judge(frf, 300.0);
  EXPECT_TRUE(right.explained) << right.reason;
  EXPECT_EQ(right.variance, ResidualVariance::scatter);
  EXPECT_NEAR(right.chi_square, right.expected, 0.1 * right.expected);
  EXPECT_FALSE(judge(frf, 330.0).explained);
}

// Resonances narrower than the line spacing scatter the lines of one part of the band, as distortion would.
TEST(ResidualVerdict, ResonancesThatAModelMissesAreNoDistortion) {
  FrfEstimate frf = noise(19, 600, 50);
  frf.response.array() += 300.0;
  for (Eigen::Index k = 40; k < 90; k += 3) frf.response.col(k) *= 3.0;
  const ResidualVerdict verdict = judge(frf, 300.0);
  EXPECT_FALSE(verdict.explained);
  EXPECT_EQ(verdict.variance, ResidualVariance::noise);
}

// Noise scatters from line to line; what a model misses is smooth.
TEST(ResidualVerdict, DataWithoutVariancesAreJudgedByTheirOwnScatter) {
  int told = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    FrfEstimate frf = noise(20 + seed, 150, 0);  // of variance 1
    frf.noise_variance.resize(0, 0);
    frf.response.array() += 300.0;
    const ResidualVerdict right = judge(frf, 300.0);
    EXPECT_EQ(right.variance, ResidualVariance::scatter);
    if (!right.explained) ++told;
    const ResidualVerdict wrong = judge(frf, 298.0);
    EXPECT_FALSE(wrong.explained);
    EXPECT_THAT(wrong.reason, HasSubstr("times what neighbouring lines differ by"));
  }
  EXPECT_EQ(told, 0);
}

// A window over the record correlates the noise of neighbouring lines: Hann, and an exponential one that ends at 1 %.
TEST(ResidualVerdict, NoiseBehindAWindowIsNotAnError) {
  constexpr Eigen::Index kReach = 8;
  const auto is_explained = [](const std::function<std::complex<double>(double)>& spectrum) {
    FrfEstimate frf = noise(18, 2000, 0);
    frf.noise_variance.resize(0, 0);
    const Eigen::MatrixXcd white = frf.response;
    frf.response.setZero();
    for (Eigen::Index m = -kReach; m <= kReach; ++m)
      frf.response.middleCols(kReach, frf.lines() - 2 * kReach) +=
          spectrum(static_cast<double>(m)) * white.middleCols(kReach + m, frf.lines() - 2 * kReach);
    return judge(select_band(frf, 20.0, 1980.0)).explained;
  };
  EXPECT_TRUE(is_explained([](double m) {
    return m == 0.0 ? 0.5 : std::abs(m) == 1.0 ? -0.25 : 0.0;
  }));
  EXPECT_TRUE(is_explained([](double m) {
    return 1.0 / std::complex<double>(std::log(100.0), 2.0 * std::numbers::pi * m);
  }));
}

TEST(ResidualVerdict, WithoutWeightsOrLinesNothingIsJudged) {
  FrfEstimate frf = noise(17, 100, 0);
  frf.response *= 100.0;
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(frf.response.rows(), 100);
  EXPECT_TRUE(judge(frf, 0.0, weights).explained);
  weights(0, 5) = 1.0;
  EXPECT_FALSE(judge(frf, 0.0, weights).explained);
  frf = noise(17, 11, 0);
  frf.noise_variance.resize(0, 0);
  const ResidualVerdict verdict = judge(frf);
  EXPECT_TRUE(verdict.explained);
  EXPECT_EQ(verdict.variance, ResidualVariance::none);
}

// 1e-10 m beside 1 N: the rounding of the large channels says nothing about the small one.
TEST(ResidualVerdict, AChannelOfSmallNumbersIsJudgedLikeTheOthers) {
  FrfEstimate frf = noise(11, 400, 0);
  for (Eigen::Index u = 0; u < kInputs; ++u) {
    frf.response.row(kOutputs * u) *= 1e-10;
    frf.noise_variance.row(kOutputs * u) *= 1e-20;
  }
  EXPECT_NEAR(judge(frf).chi_square, 1.0, 0.1);
  for (Eigen::Index u = 0; u < kInputs; ++u) frf.response.row(kOutputs * u) *= 3.0;
  EXPECT_THAT(judge(frf).reason, HasSubstr("output z1"));
}

}  // namespace stageid::test_residual_verdict
