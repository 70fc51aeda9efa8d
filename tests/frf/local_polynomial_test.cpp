// frf --method lpm on records that begin at rest: nothing is waited for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "frf/plant_frf.hpp"
#include "tests/support/sampled_loop.hpp"

namespace stageid {
namespace {

using test::AxisScheme;
using test::LoopExperiment;
using test::MemoryLog;
using test::SampledPlant;

constexpr double kSampleRateHz = 200.0;
constexpr double kNoise = 0.01;

/// Two modes close to each other; the slowest is down to 5 % after 3 s, the period is 4 s.
SampledPlant slow_stage() {
  return test::sampled_plant(2, 2, {{12.3, 1.0}, {13.6, 0.7}, {37.0, 0.2}}, kSampleRateHz, 0.5);
}

LoopExperiment slow_experiment(int periods) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 800, .axes = 2};
  x.lines = test::line_range(21, 161, 2);
  x.periods = periods;
  x.transient_periods = 0;
  return x;
}

struct Trials {
  double error = 0.0;        ///< rms over seeds and lines of |G - truth| / |truth|
  double over_stated = 0.0;  ///< mean over entries of (empirical / reported variance)
  double bias = 0.0;         ///< mean over entries of |mean error|^2 over its variance
};

Trials repeat(LoopExperiment x, const FrfOptions& options, int seeds) {
  const SampledPlant plant = slow_stage();
  Eigen::MatrixXcd sum;
  Eigen::MatrixXd squares, stated;
  Trials trials;
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = test::simulate_sampled_log(plant, x, kNoise);
    const FrfEstimate frf = estimate_plant_frf({&log}, options);
    Eigen::MatrixXcd deviation = frf.response;
    for (Eigen::Index k = 0; k < frf.lines(); ++k) {
      const Eigen::MatrixXcd G = plant.response(frf.omega_rad_s()[k], kSampleRateHz);
      deviation.col(k) -= G.reshaped();
      trials.error += deviation.col(k).squaredNorm() / G.squaredNorm();
    }
    if (seed == 1) {
      sum = Eigen::MatrixXcd::Zero(4, frf.lines());
      squares = stated = Eigen::MatrixXd::Zero(4, frf.lines());
    }
    sum += deviation;
    squares += deviation.cwiseAbs2();
    stated += frf.noise_variance;
  }
  trials.error = std::sqrt(trials.error / (seeds * static_cast<double>(sum.cols())));
  trials.over_stated = (squares.array() / stated.array()).mean();
  trials.bias = (sum.cwiseAbs2().array() / stated.array()).mean();
  return trials;
}

TEST(LocalPolynomial, WithoutNoiseTheTransientIsRemoved) {
  const SampledPlant plant = slow_stage();
  const MemoryLog log = test::simulate_sampled_log(plant, slow_experiment(4), 0.0);
  const FrfEstimate lpm = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  const FrfEstimate periodic = estimate_plant_frf({&log}, {.periods = PeriodChoice::unmarked});
  double removed = 0.0;
  double left = 0.0;
  for (Eigen::Index k = 0; k < lpm.lines(); ++k) {
    const Eigen::MatrixXcd G = plant.response(lpm.omega_rad_s()[k], kSampleRateHz);
    removed = std::max(removed, (lpm.at(k) - G).norm() / G.norm());
    left = std::max(left, (periodic.at(k) - G).norm() / G.norm());
  }
  EXPECT_LT(removed, 1e-5);
  EXPECT_GT(left, 0.05);  // what a transient that is used costs
  EXPECT_EQ(lpm.periods, 4);
  EXPECT_EQ(lpm.noise_dof, 18.0);
}

// At equal time: four periods from the start against three after one that is passed over.
TEST(LocalPolynomial, IsAsAccurateAsPassingOverAPeriod) {
  constexpr int kSeeds = 40;
  const Trials lpm = repeat(slow_experiment(4), {.method = FrfMethod::lpm}, kSeeds);
  const Trials periodic = repeat(slow_experiment(4), {.transient_periods = 1}, kSeeds);
  // 71 lines x 4 entries x 40 seeds: 1 % for an rms; the modelled transient costs (1 + leverage),
  // the period more gives 4 / 3.
  EXPECT_LT(lpm.error, 1.02 * periodic.error);
}

class Variance : public testing::TestWithParam<int> {};

// A single period too: the noise is seen on the lines that are left empty.
TEST_P(Variance, IsThatOverSeedsAndTheMeanIsUnbiased) {
  constexpr int kSeeds = 80;
  for (const AxisScheme scheme : {AxisScheme::single_axis, AxisScheme::orthogonal}) {
    LoopExperiment x = slow_experiment(GetParam());
    x.scheme = scheme;
    const Trials trials = repeat(x, {.method = FrfMethod::lpm}, kSeeds);
    // 284 entries of 80 seeds, transients of neighbouring lines share some 6 lines: sqrt(6 / (284 *
    // 80)) = 1.6 %; a bias as large as the standard error would double the second.
    EXPECT_NEAR(trials.over_stated, 1.0, 0.08);
    EXPECT_NEAR(trials.bias, 1.0, 0.5);
  }
}
INSTANTIATE_TEST_SUITE_P(Periods, Variance, testing::Values(1, 2, 4));

// Marked samples: the longest stretch of clean periods, whatever came before it.
TEST(LocalPolynomial, AMarkedPeriodLeavesTheLongestCleanStretch) {
  MemoryLog log = test::simulate_sampled_log(slow_stage(), slow_experiment(6), kNoise);
  MemoryLog cut = test::simulate_sampled_log(slow_stage(), slow_experiment(6), kNoise);
  for (std::size_t run = 0; run < 2; ++run) {
    log.records[run].marked[2 * 800 + 17] = 1;
    log.records[run].sensors.middleRows(2 * 800, 800).setConstant(1e6);
    cut.records[run].sensors = cut.records[run].sensors.bottomRows(3 * 800).eval();
    cut.records[run].actuators = cut.records[run].actuators.bottomRows(3 * 800).eval();
    cut.records[run].marked = cut.records[run].marked.tail(3 * 800).eval();
    cut.log_runs[run].samples = 3 * 800;
  }
  const FrfEstimate marked = estimate_plant_frf({&log}, {.method = FrfMethod::lpm});
  const FrfEstimate rest = estimate_plant_frf({&cut}, {.method = FrfMethod::lpm});
  EXPECT_EQ(marked.periods, 3);
  EXPECT_TRUE(marked.response == rest.response);
  EXPECT_TRUE(marked.noise_variance == rest.noise_variance);
}

TEST(LocalPolynomial, TheNumberOfThreadsDoesNotMatter) {
  const MemoryLog log = test::simulate_sampled_log(slow_stage(), slow_experiment(2), kNoise);
  const FrfEstimate one = estimate_plant_frf({&log}, {.method = FrfMethod::lpm, .threads = 1});
  const FrfEstimate three = estimate_plant_frf({&log}, {.method = FrfMethod::lpm, .threads = 3});
  EXPECT_TRUE(one.response == three.response);
  EXPECT_TRUE(one.noise_variance == three.noise_variance);
  EXPECT_EQ(one.provenance_json, three.provenance_json);
  EXPECT_NE(one.provenance_json.find(R"("method":"lpm")"), std::string::npos);
}

}  // namespace
}  // namespace stageid
