// Stated variances, checked by repeating the experiment with other noise.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <map>

#include "frf/plant/plant_frf.hpp"
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
  Eigen::VectorXd frequency_hz;
  std::vector<Eigen::MatrixXcd> deviations;  ///< one per seed: 6 x lines
  Eigen::MatrixXd noise_variance;            ///< mean over the seeds
  Eigen::MatrixXd total_variance;
  Eigen::MatrixXcd covariance;
  Eigen::MatrixXcd residual;
  Eigen::MatrixXcd input_factor;
};

Trials repeat(LoopExperiment x) {
  const test::ClosedLoop loop = test::small_stage();
  Trials trials;
  x.noise_factor = correlated_noise();
  for (int seed = 0; seed < kSeeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(1000 + seed);
    const MemoryLog log = test::simulate_log(loop, x);
    const FrfEstimate frf =
        estimate_plant_frf({&log}, {.covariance = CovarianceKind::full, .threads = 1});
    Eigen::MatrixXcd deviation = frf.response;
    for (Eigen::Index k = 0; k < frf.lines(); ++k) {
      const Eigen::MatrixXcd G = loop.plant(test::omega_of(x, k));
      deviation.col(k) -= Eigen::Map<const Eigen::VectorXcd>(G.data(), G.size());
    }
    if (trials.deviations.empty()) {
      trials.noise_variance.setZero(6, frf.lines());
      trials.total_variance.setZero(6, frf.lines());
      trials.covariance.setZero(36, frf.lines());
      trials.residual.setZero(4, frf.lines());
      trials.input_factor.setZero(9, frf.lines());
    }
    trials.deviations.push_back(deviation);
    trials.noise_variance += frf.noise_variance / kSeeds;
    if (frf.total_variance.size() != 0) trials.total_variance += frf.total_variance / kSeeds;
    trials.covariance += frf.covariance / kSeeds;
    trials.residual += frf.residual_covariance / kSeeds;
    trials.input_factor += frf.input_factor / kSeeds;
    trials.frequency_hz = frf.frequency_hz;
  }
  return trials;
}

/// Largest deviation from the unit matrix of the sample covariance on line k, whitened by `predicted`. Each entry has
/// standard deviation 1 / sqrt(kSeeds) if the prediction is right.
double largest_deviation(const Trials& trials, const Eigen::MatrixXcd& predicted, Eigen::Index k) {
  const Eigen::MatrixXcd L = predicted.llt().matrixL();
  Eigen::MatrixXcd sample = -Eigen::MatrixXcd::Identity(6, 6);
  for (const Eigen::MatrixXcd& deviation : trials.deviations) {
    const Eigen::VectorXcd w = L.triangularView<Eigen::Lower>().solve(deviation.col(k));
    sample += w * w.adjoint() / kSeeds;
  }
  return sample.cwiseAbs().maxCoeff();
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
  const Eigen::Index lines = trials.frequency_hz.size();
  for (Eigen::Index c = 0; c < 6; ++c) {
    double over_lines = 0.0;
    for (Eigen::Index k = 0; k < lines; ++k) {
      double sum = 0.0;
      for (const Eigen::MatrixXcd& deviation : trials.deviations) sum += std::norm(deviation(c, k));
      const double ratio = sum / kSeeds / trials.noise_variance(c, k);
      // 2 S ratio is chi-square with 2 S degrees of freedom: mean 1, standard deviation 1 /
      // sqrt(S). 60 ratios: 4.5 standard deviations.
      EXPECT_NEAR(ratio, 1.0, 4.5 / std::sqrt(kSeeds)) << "entry " << c << ", line " << k;
      over_lines += ratio / static_cast<double>(lines);
    }
    EXPECT_NEAR(over_lines, 1.0, 4.0 / std::sqrt(kSeeds * static_cast<double>(lines)))
        << "entry " << c;
  }
}

TEST_P(NoiseVariance, TheFullCovarianceWhitensTheDeviations) {
  const Trials& trials = this->trials();
  double worst_if_transposed = 0.0;
  for (Eigen::Index k = 0; k < trials.frequency_hz.size(); ++k) {
    const Eigen::MatrixXcd predicted =
        Eigen::Map<const Eigen::MatrixXcd>(trials.covariance.col(k).data(), 6, 6);
    EXPECT_LT(largest_deviation(trials, predicted, k), 5.0 / std::sqrt(kSeeds))  // of 360 entries
        << "line " << k;
    worst_if_transposed = std::max(
        worst_if_transposed, largest_deviation(trials, with_transpose_forgotten(predicted), k));
    for (Eigen::Index c = 0; c < 6; ++c) {
      EXPECT_NEAR(predicted(c, c).real() / trials.noise_variance(c, k), 1.0, 1e-12);
    }
  }
  // The test detects the error for which it exists.
  EXPECT_GT(worst_if_transposed, 10.0 / std::sqrt(kSeeds));
}

// A likelihood needs n_u^2 + n_y^2 numbers per line, not (n_u n_y)^2.
TEST_P(NoiseVariance, InputFactorAndResidualCovarianceMakeUpTheFullCovariance) {
  const Trials& trials = this->trials();
  for (Eigen::Index k = 0; k < trials.frequency_hz.size(); ++k) {
    Eigen::MatrixXcd predicted(6, 6);
    for (Eigen::Index j = 0; j < 3; ++j) {
      for (Eigen::Index l = 0; l < 3; ++l) {
        predicted.block(2 * j, 2 * l, 2, 2) =
            trials.input_factor(j + 3 * l, k) *
            Eigen::Map<const Eigen::MatrixXcd>(trials.residual.col(k).data(), 2, 2);
      }
    }
    EXPECT_LT(largest_deviation(trials, predicted, k), 5.0 / std::sqrt(kSeeds)) << "line " << k;
  }
}

// In the loop Y - G U is the open-loop noise for any controller: C_E = F F^H / P.
TEST_P(NoiseVariance, TheResidualCovarianceIsThatOfTheOpenLoopNoise) {
  const Trials& trials = this->trials();
  const Eigen::MatrixXcd expected = correlated_noise() * correlated_noise().adjoint() / kPeriods;
  // M E (P - 1) = 12 degrees of freedom per seed: standard deviation 1 / sqrt(12 S) = 1.7 %; 40 entries.
  for (Eigen::Index k = 0; k < trials.frequency_hz.size(); ++k) {
    const Eigen::MatrixXcd found =
        Eigen::Map<const Eigen::MatrixXcd>(trials.residual.col(k).data(), 2, 2);
    EXPECT_LT((found - expected).norm(), 0.07 * expected.norm()) << "line " << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Schemes, NoiseVariance,
                         testing::Values(AxisScheme::single_axis, AxisScheme::orthogonal),
                         [](const auto& scheme) {
                           return scheme.param == AxisScheme::orthogonal ? "Orthogonal"
                                                                         : "SingleAxis";
                         });

TEST(FrfUncertainty, WithoutDistortionsTheTotalVarianceIsTheNoiseVariance) {
  const Trials trials = repeat({.realizations = 4, .periods = 2});
  for (Eigen::Index c = 0; c < 6; ++c) {
    for (Eigen::Index k = 0; k < trials.frequency_hz.size(); ++k) {
      // M - 1 = 3 degrees of freedom per seed against M E (P - 1) = 12: relative standard deviation
      // sqrt((1/3 + 1/12) / S) = 3.7 %; 60 ratios.
      EXPECT_NEAR(trials.total_variance(c, k) / trials.noise_variance(c, k), 1.0, 4.5 * 0.037);
    }
  }
}

// Each realization has another plant (as with stochastic nonlinear contributions), without noise or loop. Then
// U R^-1 = I, G is the plain mean, and its variance follows by hand.
TEST(FrfUncertainty, TheTotalVarianceIsTheScatterOverRealizations) {
  const LoopExperiment x{.periods = 2};
  const Eigen::Index n_lines = std::ssize(x.lines);
  const std::array<double, 3> gain = {1.0, 1.1, 0.7};
  MemoryLog log;
  for (int m = 0; m < 3; ++m) {
    test::ClosedLoop loop = test::small_stage();
    loop.plant = [plant = loop.plant, g = gain[static_cast<std::size_t>(m)]](double omega) {
      return Eigen::MatrixXcd(g * plant(omega));
    };
    loop.controller = [](double) { return Eigen::MatrixXcd::Zero(3, 2); };
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
  test::ClosedLoop loop = test::small_stage();
  loop.controller = [](double) { return Eigen::MatrixXcd::Zero(3, 2); };
  LoopExperiment x{.realizations = 4, .periods = 40, .seed = 77};
  x.noise_factor = correlated_noise();
  const MemoryLog single = test::simulate_log(loop, x);
  x.scheme = AxisScheme::orthogonal;
  const MemoryLog orthogonal = test::simulate_log(loop, x);
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
  test::ClosedLoop loop = test::small_stage();
  loop.controller = [](double) { return Eigen::MatrixXcd::Zero(3, 2); };
  MemoryLog log = test::simulate_log(loop, x);
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
