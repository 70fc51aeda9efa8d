#include "frf/statistics/local_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_local_fit {

using test::ComplexNoise;

constexpr Eigen::Index kBins = 12;
constexpr Eigen::Index kChannels = 4;

/// Bins -12, -10, ..., 10 without the line, polynomials of order 2, channels that are smooth or have the given poles
/// (in units of r).
LocalProblem problem_with(const std::vector<std::complex<double>>& poles) {
  LocalProblem p;
  p.r = Eigen::VectorXd::LinSpaced(kBins, -1.0, 0.95);
  p.K.resize(3, kBins);
  p.K << Eigen::RowVectorXcd::Ones(kBins), p.r.transpose(), p.r.transpose().cwiseAbs2();
  p.k0 = Eigen::VectorXcd::Unit(3, 0);
  p.groups = {kBins};
  p.independent_noise = kChannels;
  p.pole_channels = kChannels;
  p.Z.resize(kChannels, kBins);
  for (Eigen::Index c = 0; c < kChannels; ++c) {
    const std::complex<double> shape(1.0, 0.4 * static_cast<double>(c));
    for (Eigen::Index i = 0; i < kBins; ++i) {
      p.Z(c, i) = poles.empty() ? shape + 0.3 * p.r[i] : 0.0;
      for (const std::complex<double>& pole : poles) p.Z(c, i) += shape * pole / (p.r[i] - pole);
    }
  }
  return p;
}

void add_noise(LocalProblem& p, double std, ComplexNoise& random) {
  for (Eigen::Index i = 0; i < kBins; ++i) p.Z.col(i) += std * random.gaussian(kChannels);
}

TEST(LocalFit, APolynomialIsFoundExactly) {
  const LocalFit fit = fit_locally(problem_with({}), 0);
  for (Eigen::Index c = 0; c < kChannels; ++c) {
    EXPECT_NEAR(std::abs(fit.value(c, 0) - std::complex<double>(1.0, 0.4 * static_cast<double>(c))),
                0.0, 1e-13);
  }
  EXPECT_EQ(fit.dof, 9.0);
}

// The poles are as far from the line as the bins from each other, which no polynomial can follow.
TEST(LocalFit, PolesNarrowerThanTheBinsAreFound) {
  for (const auto& poles : {std::vector<std::complex<double>>{{0.1, 0.15}},
                            std::vector<std::complex<double>>{{0.1, 0.15}, {-0.25, 0.2}}}) {
    const LocalProblem p = problem_with(poles);
    const LocalFit fit = fit_locally(p, 2);
    const LocalFit polynomial = fit_locally(p, 0);
    EXPECT_EQ(fit.poles, static_cast<int>(poles.size()));
    const double n = static_cast<double>(poles.size());
    for (Eigen::Index c = 0; c < kChannels; ++c) {
      const std::complex<double> truth =
          -n * std::complex<double>(1.0, 0.4 * static_cast<double>(c));
      // The error of a polynomial through the same bins is more than a tenth.
      EXPECT_LT(std::abs(fit.value(c, 0) - truth), 1e-8);
      EXPECT_GT(std::abs(polynomial.value(c, 0) - truth), 0.1);
    }
  }
}

TEST(LocalFit, StatedCovarianceIsTheScatterOverTrials) {
  constexpr int kTrials = 4000;
  for (const bool resonant : {false, true}) {
    using Poles = std::vector<std::complex<double>>;
    const LocalProblem clean = problem_with(resonant ? Poles{{0.1, 0.15}} : Poles{});
    const Eigen::MatrixXcd truth = fit_locally(clean, resonant ? 1 : 0).value;
    ComplexNoise random(7);
    double scatter = 0.0;
    double stated = 0.0;
    double noise = 0.0;
    for (int i = 0; i < kTrials; ++i) {
      LocalProblem p = clean;
      add_noise(p, 0.01, random);
      const LocalFit fit = fit_locally(p, resonant ? 1 : 0);
      const double variance = fit.residual.squaredNorm() / fit.dof;
      noise += variance / kTrials;
      scatter += (fit.value - truth).squaredNorm() / kTrials;
      stated += (fit.leverage[0] * variance + fit.pole_spread.squaredNorm()) / kTrials;
    }
    // 4 x 9 degrees of freedom per trial: 0.3 %; 4 values per trial: 0.8 %. The bounds are five of them, plus 1 % for
    // the first-order treatment of a pole at this signal-to-noise ratio of 100.
    EXPECT_NEAR(noise / (kChannels * 1e-4), 1.0, 0.02) << resonant;
    EXPECT_NEAR(scatter / stated, 1.0, 0.05) << resonant;
  }
}

// At most at the stated rate: channels with independent noise share one D.
TEST(LocalFit, NoiseIsSeldomTakenForAPole) {
  ComplexNoise random(3);
  int poles = 0;
  int poles_of_a_strict_test = 0;
  for (int i = 0; i < 2000; ++i) {
    LocalProblem p = problem_with({});
    add_noise(p, 1.0, random);
    poles += fit_locally(p, 1).poles;
    p.chance_of_a_pole = 0.005;
    poles_of_a_strict_test += fit_locally(p, 1).poles;
  }
  EXPECT_LE(poles, 130);                  // 5 % of 2000, and three standard deviations
  EXPECT_LE(poles_of_a_strict_test, 19);  // 0.5 %
}

/// Noise alone on zippered lines of two axes: two interleaved groups with a cubic each.
LocalProblem two_groups(Eigen::Index channels, ComplexNoise& random) {
  constexpr Eigen::Index kOfAGroup = 7;
  LocalProblem p;
  p.r.resize(2 * kOfAGroup);
  p.K.resize(4, 2 * kOfAGroup);
  for (Eigen::Index i = 0; i < p.r.size(); ++i) {
    p.r[i] = static_cast<double>(2 * (i % kOfAGroup) + i / kOfAGroup) / 6.5 - 1.0;
    for (Eigen::Index q = 0; q < 4; ++q) p.K(q, i) = std::pow(p.r[i], static_cast<double>(q));
  }
  p.k0 = Eigen::VectorXcd::Unit(4, 0);
  p.groups = {kOfAGroup, kOfAGroup};
  p.independent_noise = p.pole_channels = p.tested_noise = channels;
  p.narrowest_pole = 0.2;
  p.Z.resize(channels, p.r.size());
  for (Eigen::Index i = 0; i < p.r.size(); ++i) p.Z.col(i) = random.gaussian(channels);
  return p;
}

// var(variance) / mean^2 = 1 / nu for one with nu complex degrees of freedom.
TEST(LocalFit, VariancesOfAMeanOverPolesScatterAsTheirDegreesOfFreedomSay) {
  constexpr int kTrials = 3000;
  for (const Eigen::Index channels : {1, 2, 4}) {
    ComplexNoise random(11);
    double sum = 0.0;
    double squares = 0.0;
    double scarcity = 0.0;
    for (int i = 0; i < kTrials; ++i) {
      const LocalFit fit = average_locally(two_groups(channels, random), 3);
      const Eigen::ArrayXd variance = fit.residual.rowwise().squaredNorm().array() / fit.dof;
      sum += variance.mean() / kTrials;
      squares += variance.square().mean() / kTrials;
      scarcity += 1.0 / fit.variance_dof / kTrials;
    }
    const double found = sum * sum / (squares - sum * sum);
    // Poles are selected by what they remove: 7 % of the noise of one output.
    EXPECT_NEAR(sum, 1.0, 0.09) << channels;
    // sqrt(2 / 3000) = 2.6 % for one channel. Its fits state 5.8 degrees of freedom on average; 5.0 are found.
    EXPECT_NEAR(found * scarcity, 1.0, 0.09) << channels;
  }
}

}  // namespace stageid::test_local_fit
