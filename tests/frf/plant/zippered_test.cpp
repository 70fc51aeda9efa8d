// All axes in one experiment, each on its own lines: the responses between them are modelled.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <stdexcept>

#include "frf/health/estimate_check.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/plant/zippered_fit.hpp"
#include "tests/support/models/estimate_trials.hpp"
#include "tests/support/models/expect_same_frf.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_zippered {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;
using test::SampledPlant;
using testing::HasSubstr;

constexpr double kSampleRateHz = 200.0;
constexpr double kNoise = 0.1;

/// 2 x 2; half-power widths of 6.4, 8 and 10.6 Hz.
SampledPlant smooth_stage() {
  return test::sampled_plant(2, 2, {{12.3, 0.05}, {19.0, 0.04}, {37.0, 0.03}}, kSampleRateHz, 0.2);
}

/// Odd lines from 9 to 40 Hz in one experiment; those of an axis are 0.5 Hz apart.
LoopExperiment zippered_experiment(int periods) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 1600, .axes = 2};
  x.lines = test::line_range(73, 321, 2);
  x.periods = periods;
  x.transient_periods = 0;
  x.scheme = AxisScheme::zippered;
  return x;
}

/// Of logs with the seeds 1, 2, ...
std::vector<FrfEstimate> estimates(const SampledPlant& plant, LoopExperiment x,
                                   const FrfOptions& options, int seeds) {
  std::vector<FrfEstimate> all;
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = test::simulate_sampled_log(plant, x, kNoise);
    all.push_back(estimate_plant_frf({&log}, options));
  }
  return all;
}

TEST(Zippered, WithoutNoiseTheResponseIsThatOfThePlantOnAllLines) {
  LoopExperiment x = zippered_experiment(2);
  x.transient_periods = 2;  // fully decayed
  const MemoryLog log = test::simulate_sampled_log(smooth_stage(), x, 0.0);
  const FrfEstimate frf = estimate_plant_frf({&log});
  EXPECT_LT(test::largest_error(frf, smooth_stage()), 2e-3);
  EXPECT_EQ(frf.experiments, 1);
  // No extrapolation: the first line of the second axis, the last of the first one.
  EXPECT_EQ(frf.lines(), 123);
  EXPECT_DOUBLE_EQ(frf.frequency_hz[0], 75 * 0.125);
  EXPECT_DOUBLE_EQ(frf.frequency_hz[122], 319 * 0.125);
}

TEST(Zippered, LinesThatAreNotOfTheirOwnAreNoZipper) {
  LoopExperiment x = zippered_experiment(2);
  x.scheme = AxisScheme::orthogonal;
  const MemoryLog orthogonal = test::simulate_sampled_log(smooth_stage(), x, kNoise);
  EXPECT_FALSE(is_zippered(orthogonal));
  EXPECT_EQ(estimate_plant_frf({&orthogonal}).correlated_lines, 1.0);
  const MemoryLog zippered =
      test::simulate_sampled_log(smooth_stage(), zippered_experiment(2), 0.0);
  EXPECT_TRUE(is_zippered(zippered));
}

struct Measured {
  const char* name;
  int periods;
  FrfOptions options;
};

void PrintTo(const Measured& measured, std::ostream* os) { *os << measured.name; }

class ZipperedVariance : public testing::TestWithParam<Measured> {};

// The noise is estimated from the local models (one period), between periods (two), or beside the lines from rest
// (lpm).
TEST_P(ZipperedVariance, IsThatOverSeedsAndTheMeanIsUnbiased) {
  constexpr int kSeeds = 60;
  const test::Trials trials = test::repeat(smooth_stage(), zippered_experiment(GetParam().periods),
                                           kNoise, GetParam().options, kSeeds);
  // 123 lines x 4 entries of 60 seeds, of which every fourth line is independent: sqrt(4 / 29520) = 1.2 %. The mean of
  // 1 / (mean of 60 stated variances) adds less than 0.3 %.
  EXPECT_NEAR(1.0 / trials.over_stated, 1.0, 0.05);
  // Without bias 1 +- sqrt(4 / 492) = 9 %. A bias of a fifth of a standard deviation, which adds 4 % to the squared
  // error, adds 2.4.
  EXPECT_LT(trials.bias, 1.0 + 2.4);
}
const Measured kMeasured[] = {{"OnePeriodAfterTheTransient", 2, {.transient_periods = 1}},
                              {"TwoPeriodsAfterTheTransient", 3, {.transient_periods = 1}},
                              {"OnePeriodFromRest", 1, {.method = FrfMethod::lpm}},
                              {"ThreePeriodsFromRest", 3, {.method = FrfMethod::lpm}}};

std::string name_of(const testing::TestParamInfo<Measured>& parameter) {
  return parameter.param.name;
}

INSTANTIATE_TEST_SUITE_P(Records, ZipperedVariance, testing::ValuesIn(kMeasured, kMeasured + 3),
                         name_of);

class ZipperedDof : public testing::TestWithParam<Measured> {};

TEST_P(ZipperedDof, IsThatOfTheScatterOverSeeds) {
  // var(estimate) / mean^2 = 1 / nu for a variance with nu complex degrees of freedom.
  constexpr int kSeeds = 60;
  const LoopExperiment x = zippered_experiment(GetParam().periods);
  Eigen::ArrayXXd sum, squares;
  double dof = 0.0;
  for (const FrfEstimate& frf : estimates(smooth_stage(), x, GetParam().options, kSeeds)) {
    const Eigen::Index n_y = 2;
    const Eigen::ArrayXXd power =
        frf.residual_covariance(std::vector<Eigen::Index>{0, n_y + 1}, Eigen::all).real().array();
    if (sum.size() == 0) sum = squares = Eigen::ArrayXXd::Zero(power.rows(), power.cols());
    sum += power;
    squares += power.square();
    dof += frf.noise_dof / kSeeds;
  }
  const Eigen::ArrayXXd mean = sum / kSeeds;
  const Eigen::ArrayXXd scatter = (squares / kSeeds - mean.square()) * kSeeds / (kSeeds - 1.0);
  const double found = 1.0 / (scatter / mean.square()).mean();
  // 246 entries, about 30 of them independent, of 60 seeds: sqrt(2 / (30 * 60)) = 3.3 %.
  EXPECT_NEAR(found / dof, 1.0, 0.15) << found << ' ' << dof;
}
INSTANTIATE_TEST_SUITE_P(Records, ZipperedDof, testing::ValuesIn(kMeasured), name_of);

// The mean of a smooth function of the lines, as in a fit, has the variance predicted by correlated_lines.
TEST(Zippered, CorrelatedLinesSayWhatTheMeanOverTheBandIsWorth) {
  constexpr int kSeeds = 150;
  Eigen::Array4cd sum = Eigen::Array4cd::Zero();
  Eigen::Array4d squares = Eigen::Array4d::Zero();
  Eigen::Array4d stated = Eigen::Array4d::Zero();
  Eigen::MatrixXd weights;  // the same for all seeds: their mean is of a linear function
  for (const FrfEstimate& frf :
       estimates(smooth_stage(), zippered_experiment(2), {.transient_periods = 1}, kSeeds)) {
    if (weights.size() == 0) weights = frf.response.cwiseAbs2().cwiseInverse();
    for (Eigen::Index c = 0; c < 4; ++c) {
      const Eigen::ArrayXd w = weights.row(c).transpose().array() / weights.row(c).sum();
      const std::complex<double> mean =
          (w.cast<std::complex<double>>() * frf.response.row(c).transpose().array()).sum();
      sum[c] += mean;
      squares[c] += std::norm(mean);
      stated[c] += frf.correlated_lines *
                   (w.square() * frf.noise_variance.row(c).transpose().array()).sum() / kSeeds;
    }
  }
  const Eigen::Array4d scatter = (squares - sum.abs2() / kSeeds) / (kSeeds - 1.0);
  // 600 values: 4 %. Without the factor the ratio would be more than 4.
  EXPECT_NEAR((scatter / stated).mean(), 1.0, 0.25);
}

/// Stated covariance of an output's responses to the first and the second input, over 60 seeds, against products of
/// their errors.
struct InputCovariance {
  double straight = 0.0;  ///< mean error product over the stated one; 1 if they agree
  double conjugated =
      0.0;  ///< the same with the stated one's conjugate, as a transpose too many has it
};

InputCovariance covariance_between_inputs(const SampledPlant& plant, double low_hz,
                                          double high_hz) {
  constexpr int kSeeds = 60;
  const FrfOptions options{.transient_periods = 1, .covariance = CovarianceKind::full};
  Eigen::MatrixXcd found, stated;  // vec of Cov(vec G), one column per line, summed over the seeds
  for (const FrfEstimate& whole : estimates(plant, zippered_experiment(2), options, kSeeds)) {
    const FrfEstimate frf = select_band(whole, low_hz, high_hz);
    if (found.size() == 0) found = stated = Eigen::MatrixXcd::Zero(16, frf.lines());
    for (Eigen::Index k = 0; k < frf.lines(); ++k) {
      const Eigen::VectorXcd error =
          (frf.at(k) - plant.response(frf.omega_rad_s()[k], kSampleRateHz)).reshaped();
      found.col(k) += (error * error.adjoint()).reshaped();
    }
    stated += frf.covariance;
  }
  InputCovariance sum;
  double size = 0.0;
  for (Eigen::Index k = 0; k < found.cols(); ++k) {
    const Eigen::MatrixXcd F = found.col(k).reshaped(4, 4);
    const Eigen::MatrixXcd S = stated.col(k).reshaped(4, 4);
    for (Eigen::Index i = 0; i < 2; ++i) {  // output i, from the first input and from the second
      const double scale = 1.0 / (S(i, i).real() * S(2 + i, 2 + i).real());
      sum.straight += scale * (F(i, 2 + i) * std::conj(S(i, 2 + i))).real();
      sum.conjugated += scale * (F(i, 2 + i) * S(i, 2 + i)).real();
      size += scale * std::norm(S(i, 2 + i));
    }
  }
  return {sum.straight / size, sum.conjugated / size};
}

// The covariance between the two inputs too, because only there a wrong transpose or conjugate of U^-1 has an effect.
TEST(Zippered, TheCovarianceBetweenInputsIsThatOverSeeds) {
  SampledPlant plant = smooth_stage();
  plant.K << 0.0, 6.0, 6.0, 0.0;  // each input follows the other; the loop's poles are below 0.92
  const InputCovariance found = covariance_between_inputs(plant, 9.0, 41.0);
  // Correlations of about 0.5, products with a scatter of 1: 246 entries, one of four independent, of 60 seeds: 3.3 %.
  EXPECT_NEAR(found.straight, 1.0, 0.13);
  EXPECT_LT(found.conjugated, 0.5);
}

TEST(Zippered, TotalVarianceIsThatOfTheRealizations) {
  LoopExperiment x = zippered_experiment(2);
  x.realizations = 30;
  const MemoryLog log = test::simulate_sampled_log(smooth_stage(), x, kNoise);
  const FrfEstimate frf = estimate_plant_frf({&log}, {.transient_periods = 1});
  ASSERT_EQ(frf.total_dof, 29.0);
  // A linear plant: both estimate the same; 492 entries, one of four independent, 29 dof: 2 %.
  EXPECT_NEAR((frf.total_variance.array() / frf.noise_variance.array()).mean(), 1.0, 0.08);
  EXPECT_THAT(why_linearity_cannot_be_tested(frf), HasSubstr("zippered"));
}

TEST(Zippered, TheNumberOfThreadsDoesNotMatterAndABandIsSelectedWhole) {
  LoopExperiment x = zippered_experiment(3);
  x.realizations = 2;
  const MemoryLog log = test::simulate_sampled_log(smooth_stage(), x, kNoise);
  const FrfEstimate one = estimate_plant_frf({&log}, {.transient_periods = 1, .threads = 1});
  test::expect_same(one, estimate_plant_frf({&log}, {.transient_periods = 1, .threads = 3}));
  EXPECT_GT(one.correlated_lines, 2.0);
  const FrfEstimate band = select_band(one, 15.0, 20.0);
  EXPECT_EQ(band.interpolation_misfit.size(), band.lines());
}

std::string refusal(const std::vector<const LogReader*>& logs, const FrfOptions& options = {}) {
  return test::error_message<std::invalid_argument>([&] { estimate_plant_frf(logs, options); });
}

std::string refusal(const LoopExperiment& x, const FrfOptions& options) {
  const MemoryLog log = test::simulate_sampled_log(smooth_stage(), x, kNoise);
  return refusal({&log}, options);
}

TEST(Zippered, WhatCannotWorkIsRefused) {
  LoopExperiment few = zippered_experiment(2);
  few.lines = test::line_range(73, 97, 2);
  EXPECT_THAT(refusal(few, {}),
              HasSubstr("a2 is excited on 6 of the 13 lines, but 7 are required"));
  EXPECT_THAT(refusal(zippered_experiment(2), {.covariance_lines = 5}),
              HasSubstr("zippered lines already estimate it"));
  LoopExperiment all = zippered_experiment(1);
  all.lines = test::line_range(73, 321, 1);
  EXPECT_THAT(refusal(all, {.method = FrfMethod::lpm}), HasSubstr("Excite only odd lines"));
}

TEST(Zippered, RealizationsMustGiveAnAxisTheSameLines) {
  LoopExperiment x = zippered_experiment(2);
  MemoryLog log = test::simulate_sampled_log(smooth_stage(), x, kNoise);
  MemoryLog other = log;
  other.log_runs[0].realization = 1;
  Eigen::MatrixXd& period = other.excitation_periods[0];
  period.col(0).swap(period.col(1));
  EXPECT_THAT(refusal({&log, &other}), HasSubstr("the axes have different lines than in"));
}

/// A mode whose half-power width is `width` times the distance of an axis' lines, between smooth ones.
SampledPlant sharp_stage(double width) {
  return test::sampled_plant(
      2, 2, {{12.3, 0.1}, {24.3, 1.0 / (std::numbers::pi * 0.5 * width)}, {37.0, 0.05}},
      kSampleRateHz, 0.05);
}

// The poles of the local model follow a resonance as narrow as the lines, which a polynomial cannot.
TEST(Zippered, ResonancesAsNarrowAsTheLinesAreFollowed) {
  for (const double width : {1.0, 2.0}) {
    const SampledPlant plant = sharp_stage(width);
    constexpr int kSeeds = 40;
    Eigen::MatrixXcd sum;
    Eigen::ArrayXXd stated;
    for (const FrfEstimate& whole :
         estimates(plant, zippered_experiment(2), {.transient_periods = 1}, kSeeds)) {
      const FrfEstimate frf = select_band(whole, 24.3 - 0.5 * width, 24.3 + 0.5 * width);
      if (sum.size() == 0) {
        sum.setZero(4, frf.lines());
        stated.setZero(4, frf.lines());
      }
      for (Eigen::Index k = 0; k < frf.lines(); ++k)
        sum.col(k) += (frf.at(k) - plant.response(frf.omega_rad_s()[k], kSampleRateHz)).reshaped();
      stated += frf.noise_variance.array();
    }
    // Squared bias over variance; noise contributes 1 / 40 to the mean of 40 seeds.
    const double bias = (sum / kSeeds).cwiseAbs2().cwiseQuotient((stated / kSeeds).matrix()).mean();
    EXPECT_LT(bias, 0.5) << width;
  }
}

// On a resonance, the uncertainty of the pole affects the responses to both inputs, with the phase between their
// residues: 90 degrees here, because the second input acts on the other state.
TEST(Zippered, NotKnowingThePoleCorrelatesInputsByTheirResidues) {
  SampledPlant plant = sharp_stage(1.0);
  for (Eigen::Index i = 0; i < plant.A.rows(); i += 2) plant.B.col(1).segment(i, 2) << 0.0, 0.1;
  const InputCovariance found = covariance_between_inputs(plant, 23.8, 24.8);
  EXPECT_GT(found.straight, 0.5);
  EXPECT_LT(found.conjugated, 0.0);
}

TEST(Zippered, WhereTheInterpolationFailsIsSaid) {
  LoopExperiment x = zippered_experiment(3);
  const MemoryLog smooth = test::simulate_sampled_log(smooth_stage(), x, kNoise);
  EXPECT_TRUE(check_interpolation(estimate_plant_frf({&smooth}, {.transient_periods = 1})).empty());
  // Three resonances in one window, each a tenth of the lines' distance wide.
  const SampledPlant plant =
      test::sampled_plant(2, 2, {{12.3, 0.1}, {23.7, 3.0}, {24.3, 3.0}, {25.0, 3.0}, {37.0, 0.05}},
                          kSampleRateHz, 0.01);
  x.periods = 6;
  const MemoryLog log = test::simulate_sampled_log(plant, x, 0.1 * kNoise);
  const std::vector<Finding> found =
      check_interpolation(estimate_plant_frf({&log}, {.transient_periods = 4}));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].severity, Severity::doubt);
  EXPECT_EQ(found[0].cause, Cause::interpolation);
  EXPECT_THAT(found[0].figure, HasSubstr("times the noise at 2"));
}

}  // namespace stageid::test_zippered
