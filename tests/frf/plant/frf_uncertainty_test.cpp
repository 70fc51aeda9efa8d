// Stated variances, checked by repeating the experiment with other noise.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "excitation/decompositions/decompositions.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_frf_uncertainty {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;

constexpr int kSeeds = 300;

/// Correlated noise at the two sensors; covariance F F^H per line and period.
Eigen::MatrixXcd correlated_noise() {
  Eigen::MatrixXcd factor(2, 2);
  factor << std::complex<double>(1.0, 0.0), 0.0, std::complex<double>(0.5, 0.6),
      std::complex<double>(0.7, 0.0);
  return 0.01 * factor;
}

/// Deviations from the truth and the predicted covariance, over seeds.
struct Trials {
  std::vector<Eigen::MatrixXcd> deviations;  ///< one per line: 6 x seeds
  FrfEstimate mean;                          ///< of variances and covariances
};

Trials repeat(LoopExperiment x) {
  const test::ClosedLoop loop = test::small_stage();
  Trials trials;
  trials.deviations.assign(x.lines.size(), Eigen::MatrixXcd(6, kSeeds));
  x.noise_factor = correlated_noise();
  for (int seed = 0; seed < kSeeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(1000 + seed);
    const MemoryLog log = test::simulate_log(loop, x);
    const FrfEstimate frf =
        estimate_plant_frf({&log}, {.covariance = CovarianceKind::full, .threads = 1});
    for (Eigen::Index k = 0; k < frf.lines(); ++k)
      trials.deviations[k].col(seed) =
          frf.response.col(k) - loop.plant(test::omega_of(x, k)).reshaped();
    const auto average = [seed](auto& mean, const auto& value) {
      if (seed == 0) mean.setZero(value.rows(), value.cols());
      mean += value / kSeeds;
    };
    average(trials.mean.noise_variance, frf.noise_variance);
    average(trials.mean.total_variance, frf.total_variance);
    average(trials.mean.covariance, frf.covariance);
    average(trials.mean.residual_covariance, frf.residual_covariance);
    average(trials.mean.input_factor, frf.input_factor);
  }
  return trials;
}

/// Largest deviation from the unit matrix of the sample covariance on line k, whitened by `predicted`. Each entry has
/// standard deviation 1 / sqrt(kSeeds) if the prediction is right.
double largest_deviation(const Trials& trials, const Eigen::MatrixXcd& predicted, std::size_t k) {
  const Eigen::MatrixXcd L = test::cholesky(predicted);
  const Eigen::MatrixXcd white = solve(L, trials.deviations[k]);
  const Eigen::MatrixXcd sample = white * white.adjoint() / kSeeds;
  return (sample - Eigen::MatrixXcd::Identity(6, 6)).cwiseAbs().maxCoeff();
}

/// Cov(vec G) = A kron C_E with A transposed: the result of omitting the transpose of U^-T.
Eigen::MatrixXcd with_transpose_forgotten(const Eigen::MatrixXcd& covariance) {
  Eigen::MatrixXcd wrong(6, 6);
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) {
      // Only A is transposed; C_E is unchanged, with its scale from the block's trace.
      const Eigen::MatrixXcd unit =
          covariance.topLeftCorner(2, 2) / covariance.topLeftCorner(2, 2).trace();
      wrong.block(2 * i, 2 * j, 2, 2) = covariance.block(2 * j, 2 * i, 2, 2).trace() * unit;
    }
  }
  return wrong;
}

class NoiseVariance : public testing::TestWithParam<AxisScheme> {
 protected:
  static constexpr int kPeriods = 3;
  /// Two realizations of the scheme; simulated once for all tests.
  static const Trials& trials() {
    static std::map<AxisScheme, Trials> all;
    const auto found = all.find(GetParam());
    if (found != all.end()) return found->second;
    return all[GetParam()] = repeat({.realizations = 2, .periods = kPeriods, .scheme = GetParam()});
  }
};

TEST_P(NoiseVariance, TheSampleVarianceLiesInItsChiSquareInterval) {
  const Trials& trials = this->trials();
  const std::size_t lines = trials.deviations.size();
  Eigen::MatrixXd ratio(6, lines);
  for (std::size_t k = 0; k < lines; ++k)
    ratio.col(k) = trials.deviations[k].rowwise().squaredNorm() / kSeeds;
  ratio = ratio.cwiseQuotient(trials.mean.noise_variance).eval();
  // 2 S ratio is chi-square with 2 S degrees of freedom: mean 1, standard deviation 1 / sqrt(S). 60 ratios: 4.5
  // standard deviations.
  EXPECT_LT((ratio.array() - 1.0).abs().maxCoeff(), 4.5 / std::sqrt(kSeeds)) << ratio;
  EXPECT_LT((ratio.rowwise().mean().array() - 1.0).abs().maxCoeff(),
            4.0 / std::sqrt(kSeeds * static_cast<double>(lines)))
      << ratio;
}

TEST_P(NoiseVariance, TheFullCovarianceWhitensTheDeviations) {
  const Trials& trials = this->trials();
  double worst_if_transposed = 0.0;
  for (std::size_t k = 0; k < trials.deviations.size(); ++k) {
    const Eigen::MatrixXcd predicted = trials.mean.covariance.col(k).reshaped(6, 6);
    EXPECT_LT(largest_deviation(trials, predicted, k), 5.0 / std::sqrt(kSeeds))  // of 360 entries
        << "line " << k;
    worst_if_transposed = std::max(
        worst_if_transposed, largest_deviation(trials, with_transpose_forgotten(predicted), k));
    for (Eigen::Index c = 0; c < 6; ++c)
      EXPECT_NEAR(predicted(c, c).real() / trials.mean.noise_variance(c, k), 1.0, 1e-12);
  }
  // The test detects the error for which it exists.
  EXPECT_GT(worst_if_transposed, 10.0 / std::sqrt(kSeeds));
}

// A likelihood needs n_u^2 + n_y^2 numbers per line, not (n_u n_y)^2.
TEST_P(NoiseVariance, InputFactorAndResidualCovarianceMakeUpTheFullCovariance) {
  const Trials& trials = this->trials();
  for (std::size_t k = 0; k < trials.deviations.size(); ++k) {
    const Eigen::MatrixXcd C_E = trials.mean.residual_covariance.col(k).reshaped(2, 2);
    Eigen::MatrixXcd predicted(6, 6);
    for (Eigen::Index j = 0; j < 3; ++j)
      for (Eigen::Index l = 0; l < 3; ++l)
        predicted.block(2 * j, 2 * l, 2, 2) = trials.mean.input_factor(j + 3 * l, k) * C_E;
    EXPECT_LT(largest_deviation(trials, predicted, k), 5.0 / std::sqrt(kSeeds)) << "line " << k;
  }
}

// In the loop Y - G U is the open-loop noise for any controller: C_E = F F^H / P.
TEST_P(NoiseVariance, TheResidualCovarianceIsThatOfTheOpenLoopNoise) {
  const Eigen::MatrixXcd expected = correlated_noise() * correlated_noise().adjoint() / kPeriods;
  // M E (P - 1) = 12 degrees of freedom per seed: standard deviation 1 / sqrt(12 S) = 1.7 %; 40 entries.
  const Eigen::MatrixXcd& found = trials().mean.residual_covariance;
  for (Eigen::Index k = 0; k < found.cols(); ++k)
    EXPECT_LT((found.col(k) - expected.reshaped()).norm(), 0.07 * expected.norm()) << "line " << k;
}

INSTANTIATE_TEST_SUITE_P(Schemes, NoiseVariance,
                         testing::Values(AxisScheme::single_axis, AxisScheme::orthogonal),
                         [](const auto& scheme) {
                           return scheme.param == AxisScheme::orthogonal ? "Orthogonal"
                                                                         : "SingleAxis";
                         });

TEST(FrfUncertainty, WithoutDistortionsTheTotalVarianceIsTheNoiseVariance) {
  const FrfEstimate mean = repeat({.realizations = 4, .periods = 2}).mean;
  // M - 1 = 3 degrees of freedom per seed against M E (P - 1) = 12: relative standard deviation
  // sqrt((1/3 + 1/12) / S) = 3.7 %; 60 ratios.
  const Eigen::ArrayXXd ratio = mean.total_variance.array() / mean.noise_variance.array();
  EXPECT_LT((ratio - 1.0).abs().maxCoeff(), 4.5 * 0.037) << ratio;
}

// Each realization has another plant (as with stochastic nonlinear contributions), without noise or loop. Then
// U R^-1 = I, G is the plain mean, and its variance follows by hand.
TEST(FrfUncertainty, TheTotalVarianceIsTheScatterOverRealizations) {
  const LoopExperiment x{.periods = 2};
  const Eigen::Index n_lines = std::ssize(x.lines);
  const std::array<double, 3> gain = {1.0, 1.1, 0.7};
  MemoryLog log;
  for (int m = 0; m < 3; ++m) {
    test::ClosedLoop loop = test::open_loop();
    loop.plant = [plant = loop.plant, g = gain[static_cast<std::size_t>(m)]](double omega) {
      return Eigen::MatrixXcd(g * plant(omega));
    };
    const MemoryLog one = test::simulate_log(loop, x);
    if (m == 0) log.log_info = one.log_info;
    for (int e = 0; e < 3; ++e) {
      const auto run = static_cast<std::size_t>(e);
      log.append(m, e, one.excitation_periods[run], one.records[run]);
    }
  }

  const FrfEstimate frf = estimate_plant_frf({&log});

  const double mean = (1.0 + 1.1 + 0.7) / 3.0;
  double scatter = 0.0;
  for (const double g : gain) scatter += (g - mean) * (g - mean);
  const double of_the_mean = scatter / (3.0 * 2.0);
  for (Eigen::Index k = 0; k < n_lines; ++k) {
    const Eigen::MatrixXcd G = test::small_stage().plant(test::omega_of(x, k));
    EXPECT_LT((frf.at(k) - mean * G).norm(), 1e-10 * G.norm());
    for (Eigen::Index c = 0; c < 6; ++c) {
      EXPECT_NEAR(frf.total_variance(c, k) / (of_the_mean * std::norm(G.data()[c])), 1.0, 1e-8);
      EXPECT_LT(frf.noise_variance(c, k), 1e-15 * frf.total_variance(c, k));  // rounding, squared
    }
  }
  EXPECT_EQ(frf.total_dof, 2.0);
}

TEST(FrfUncertainty, OrthogonalExperimentsDivideTheVarianceByTheNumberOfAxes) {
  LoopExperiment x{.realizations = 4, .periods = 40, .seed = 77};
  x.noise_factor = correlated_noise();
  const MemoryLog single = test::simulate_log(test::open_loop(), x);
  x.scheme = AxisScheme::orthogonal;
  const MemoryLog orthogonal = test::simulate_log(test::open_loop(), x);
  // Open loop, amplitude 1: Var = C_E,ii / (M P) against the same over 3. M E (P - 1) = 468 degrees of freedom on each
  // of 10 lines: 1.5 % per mean.
  const double ratio = (estimate_plant_frf({&single}).noise_variance.array() /
                        estimate_plant_frf({&orthogonal}).noise_variance.array())
                           .mean();
  EXPECT_NEAR(ratio, 3.0, 0.3);
}

// If the noise of one run is larger than that of the others, the pooled covariance still has the right mean: all
// periods have the same weight.
TEST(FrfUncertainty, RunsOfUnequalLengthAreWeightedByTheirPeriods) {
  LoopExperiment x{.periods = 6, .seed = 12};
  x.noise_factor = correlated_noise();
  MemoryLog log = test::simulate_log(test::open_loop(), x);
  const FrfEstimate equal = estimate_plant_frf({&log});
  log.log_runs[0].samples = 3 * 250;  // 2 of 6 periods
  const FrfEstimate cut = estimate_plant_frf({&log});
  EXPECT_EQ(cut.periods, 2);
  EXPECT_EQ(cut.noise_dof, 1.0 + 5.0 + 5.0);
  // Column 0 depends on the truncated run alone (open loop, single axis), the others not at all:
  // Var_i0 / Var_i1 = P_1 / P_0 = 3, exactly, because the covariance is pooled.
  for (Eigen::Index k = 0; k < cut.lines(); ++k) {
    EXPECT_NEAR(cut.noise_variance(0, k) / cut.noise_variance(2, k), 3.0, 0.05);
    EXPECT_NEAR(equal.noise_variance(0, k) / equal.noise_variance(2, k), 1.0, 0.02);
  }
}

}  // namespace stageid::test_frf_uncertainty
