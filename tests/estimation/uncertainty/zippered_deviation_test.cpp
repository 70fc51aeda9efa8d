// Standard deviations of a fit to a zippered experiment, whose lines share their data.
#include <gtest/gtest.h>

#include "tests/support/models/zippered_fits.hpp"

namespace stageid::test_zippered_deviation {

constexpr double kSampleRateHz = 200.0;

// 2 x 2, modes some six distances of an axis' lines wide.
TEST(ZipperedDeviation, IsThatOverSeeds) {
  constexpr int kSeeds = 60;
  const std::vector<test::PlantMode> modes = {{12.3, 0.106}, {24.0, 0.085}, {37.0, 0.064}};
  const test::SampledPlant plant = test::sampled_plant(2, 2, modes, kSampleRateHz, 0.1);
  test::LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 1600, .axes = 2};
  x.lines = test::line_range(73, 321, 2);
  x.periods = 2;
  x.transient_periods = 0;
  x.scheme = test::AxisScheme::zippered;
  const test::FitTrials trials = test::repeat_fits(plant, modes, x, 0.1, {.transient_periods = 1},
                                                   Weighting::noise_variance, kSeeds);
  // Six ratios of 60 seeds: 3.7 %. Taken for independent, the lines would have made it 2.3.
  EXPECT_NEAR(std::sqrt(trials.over_reported.square().mean()), 1.0, 0.18);
  EXPECT_GT(trials.correlated_lines, 4.0);
}

}  // namespace stageid::test_zippered_deviation
