// Benefit of frf --method lpm on a loop that settles slowly: a 4 x 13 stage whose slowest mode decays to 5 % in 3 s,
// measured from rest with periods of 4 s.
//
//   local_polynomial_study [seeds = 30]
//
// Prints the rms error of P periods from rest (lpm) relative to that of the same time with the first period skipped;
// and for records of 1, 2 and 4 periods the empirical relative to the stated variance, and the squared mean error
// relative to the variance of that mean (1: unbiased).
#include <fmt/format.h>

#include <cstdlib>

#include "tests/support/models/estimate_trials.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

constexpr double kSampleRateHz = 200.0;
constexpr double kNoise = 0.01;

LoopExperiment experiment(int periods) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 800, .axes = 13};
  x.lines = line_range(21, 161, 2);
  x.periods = periods;
  x.transient_periods = 0;
  x.scheme = AxisScheme::orthogonal;
  return x;
}

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 30;
  const auto plant = sampled_plant(4, 13, {{12.3, 1.0}, {13.6, 0.7}, {24.0, 0.4}, {37.0, 0.2}},
                                   kSampleRateHz, 0.1);
  for (const int periods : {3, 4, 10}) {
    const Trials lpm =
        repeat(plant, experiment(periods), kNoise, {.method = FrfMethod::lpm}, seeds);
    const Trials waited =
        repeat(plant, experiment(periods), kNoise, {.transient_periods = 1}, seeds);
    const Trials not_waited =
        repeat(plant, experiment(periods), kNoise, {.periods = PeriodChoice::unmarked}, seeds);
    fmt::print(
        "{:2} periods: error {:.3e} lpm, {:.3e} one passed over, {:.3e} none; lpm / passed "
        "over {:.3f}\n",
        periods, lpm.error, waited.error, not_waited.error, lpm.error / waited.error);
  }
  for (const int periods : {1, 2, 4}) {
    const Trials lpm =
        repeat(plant, experiment(periods), kNoise, {.method = FrfMethod::lpm}, seeds);
    fmt::print(
        "{:2} periods: empirical / stated variance {:.3f}, squared bias / its variance {:.3f}\n",
        periods, lpm.over_stated, lpm.bias);
  }
  return 0;
}
