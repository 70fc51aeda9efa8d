#include "frf/response/leaked_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/models/estimate_trials.hpp"

namespace stageid::test_leaked_noise {

using test::LoopExperiment;
using test::MemoryLog;

constexpr Eigen::Index kLines = 400;
constexpr int kDof = 12;

/// Mean of `dof` squared magnitudes: a variance as the estimate has it.
double mean_power(int dof, test::ComplexNoise& random) {
  return random.gaussian(dof).squaredNorm() / dof;
}

/// Two outputs and inputs; the total variance of output i is total_over_noise[i] times that of the noise.
struct Example {
  FrfEstimate frf;
  RealizationScatter scatter;

  explicit Example(const Eigen::Vector2d& total_over_noise, std::uint64_t seed = 1) {
    test::ComplexNoise random(seed);
    frf.inputs = test::channels("u", 2, "N");
    frf.outputs = test::channels("y", 2, "m");
    frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 10.0, 400.0);
    frf.response = Eigen::MatrixXcd::Ones(4, kLines);
    frf.realizations = 3;
    frf.total_dof = 2.0;
    frf.noise_dof = kDof;
    frf.noise_variance.resize(4, kLines);
    frf.total_variance.resize(4, kLines);
    for (Eigen::Index k = 0; k < kLines; ++k)
      for (Eigen::Index c = 0; c < 4; ++c) {
        frf.noise_variance(c, k) = mean_power(kDof, random);
        frf.total_variance(c, k) = total_over_noise[c % 2] * mean_power(2, random);
      }
    frf.residual_covariance.resize(4, kLines);
    const std::complex<double> between(0.3, 0.2);
    for (Eigen::Index k = 0; k < kLines; ++k)
      frf.residual_covariance.col(k) << frf.noise_variance(0, k), between, std::conj(between),
          frf.noise_variance(1, k);
    scatter = {frf.total_variance, frf.noise_variance, kDof};
  }
};

TEST(LeakedNoise, TheNoiseBecomesThatOfTheRealizations) {
  Example example({0.2, 1.0});
  const FrfEstimate before = example.frf;
  lower_leaked_noise(example.scatter, example.frf);
  const Eigen::ArrayXd factor =
      (example.frf.noise_variance.array() / before.noise_variance.array()).rowwise().mean();
  EXPECT_NEAR(factor[0], 0.2, 0.02);
  EXPECT_NEAR(factor[2], 0.2, 0.02);
  EXPECT_EQ(factor[1], 1.0);  // an output without leakage keeps its variance
  EXPECT_EQ(factor[3], 1.0);
}

TEST(LeakedNoise, TheCovarianceKeepsItsCorrelation) {
  Example example({0.2, 0.5});
  const auto correlation = [&example](Eigen::Index k) {
    const Eigen::MatrixXcd C = output_covariance(example.frf, k);
    return C(0, 1) / std::sqrt(C(0, 0).real() * C(1, 1).real());
  };
  const std::complex<double> before = correlation(7);
  const double scale =
      example.frf.residual_covariance(0, 7).real() / example.frf.noise_variance(0, 7);
  example.frf.covariance.resize(16, kLines);
  for (Eigen::Index k = 0; k < kLines; ++k) {
    Eigen::MatrixXcd whole = Eigen::MatrixXcd::Zero(4, 4);
    whole.topLeftCorner(2, 2) = whole.bottomRightCorner(2, 2) = output_covariance(example.frf, k);
    example.frf.covariance.col(k) = whole.reshaped();
  }
  lower_leaked_noise(example.scatter, example.frf);
  EXPECT_LT(std::abs(correlation(7) - before), 1e-12);
  EXPECT_NEAR(example.frf.residual_covariance(0, 7).real(),
              scale * example.frf.noise_variance(0, 7), 1e-12);
  const Eigen::MatrixXcd whole = example.frf.covariance.col(7).reshaped(4, 4);
  EXPECT_LT((whole.topLeftCorner(2, 2) - output_covariance(example.frf, 7)).norm(), 1e-12);
}

// By chance, the noise of one in a hundred estimates is lowered; distortion and transients are tested elsewhere.
TEST(LeakedNoise, WithoutLeakageNothingChanges) {
  int changed = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    Example example({1.0, seed % 2 == 0 ? 1.0 : 3.0}, seed);
    const Eigen::MatrixXd before = example.frf.noise_variance;
    lower_leaked_noise(example.scatter, example.frf);
    if (example.frf.noise_variance != before) ++changed;
  }
  EXPECT_LE(changed, 8);
}

TEST(LeakedNoise, CopiesOfARealizationKeepAVarianceAndOneAloneShowsNothing) {
  Example copies({0.0, 0.0});
  lower_leaked_noise(copies.scatter, copies.frf);
  EXPECT_GT(copies.frf.noise_variance.minCoeff(), 0.0);
  Example one({0.2, 0.2});
  const Eigen::MatrixXd before = one.frf.noise_variance;
  lower_leaked_noise({}, one.frf);
  EXPECT_EQ(one.frf.noise_variance, before);
}

/// Mean over the lines and entries of |G - G_0|^2 over its variance, for a loop with a slow force on actuator 0.
double error_over_variance(std::uint64_t seed) {
  test::SampledPlant plant = test::sampled_plant(2, 2, {{60.0, 0.03}, {170.0, 0.02}}, 1000.0, 0.02);
  test::ComplexNoise random(seed);
  double force = 0.0;
  plant.applied = [&](Eigen::Index i, double command) {
    if (i != 0) return command;
    force = 0.999 * force + 0.5 * test::real_gaussian(random);
    return command + force;
  };
  LoopExperiment x{.period_samples = 500, .axes = 2, .realizations = 4, .periods = 4};
  x.lines = test::line_range(10, 150, 1);
  x.transient_periods = 2;
  x.seed = seed;
  const MemoryLog log = test::simulate_sampled_log(plant, x, 1e-3);
  const FrfEstimate frf = estimate_plant_frf({&log}, {.threads = 1});
  return test::error_over_variance(frf, plant);
}

// A random force of 1 s moves the stage slowly: every period of 0.5 s ends elsewhere than it begins.
TEST(LeakedNoise, TheErrorsOfALoopWithASlowForceHaveTheirVariance) {
  double mean = 0.0;
  constexpr int kSeeds = 20;
  for (int seed = 1; seed <= kSeeds; ++seed)
    mean += error_over_variance(static_cast<std::uint64_t>(seed)) / kSeeds;
  EXPECT_GT(mean, 0.85);
  EXPECT_LT(mean, 1.2);
}

}  // namespace stageid::test_leaked_noise
