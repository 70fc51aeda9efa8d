// Do the standard deviations of a fit hold where the lines of the response are correlated?
//
//   zippered_fit_study [seeds = 200] [outputs = 2] [inputs = 2] [noise = 0.1] [width = 6]
//
// Three modes, half-power widths of `width`, 1.25 and 1.65 times that in distances of an axis' lines. One
// line a record and weighting: scatter of every natural frequency and damping ratio over the seeds over
// the reported standard deviation, with the mean error over its own deviation; then all together. The
// orthogonal scheme, whose lines are independent, is there to be compared with.
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/benchmark/arguments.hpp"
#include "tests/support/models/zippered_fits.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

constexpr double kSampleRateHz = 200.0;
constexpr double kLineDistanceHz = 0.5;  // of an axis

struct Record {
  const char* what;
  AxisScheme scheme;
  int periods;
  FrfOptions options;
};

/// Odd lines of 9 to 40 Hz; those of an axis are 0.5 Hz apart in both schemes.
LoopExperiment experiment(const Record& record, int axes) {
  const int share = record.scheme == AxisScheme::zippered ? axes : 1;
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 800 * share, .axes = axes};
  x.lines = line_range(36 * share + 1, 160 * share + 1, 2);
  x.periods = record.periods;
  x.transient_periods = 0;
  x.scheme = record.scheme;
  return x;
}

void print(const char* what, const char* weighting, const FitTrials& trials, int seeds) {
  fmt::print("{:36} {:14} correlated lines {:5.2f}, scatter / reported", what, weighting,
             trials.correlated_lines);
  for (Eigen::Index i = 0; i < trials.over_reported.size(); i += 2)
    fmt::print(" f {:.2f} ({:+.1f}) z {:.2f} ({:+.1f})", trials.over_reported[i], trials.bias[i],
               trials.over_reported[i + 1], trials.bias[i + 1]);
  const auto n = static_cast<double>(trials.over_reported.size());
  fmt::print("; all {:.3f} +- {:.3f}\n", std::sqrt(trials.over_reported.square().mean()),
             1.0 / std::sqrt(2.0 * seeds * n));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments number(argc, argv);
  const int seeds = number(1, 200);
  const int outputs = number(2, 2);
  const int inputs = number(3, 2);
  const double noise = number(4, 0.1);
  const double decay_s = 1.0 / (std::numbers::pi * kLineDistanceHz * number(5, 6.0));
  const std::vector<PlantMode> modes = {
      {12.3, decay_s}, {24.0, decay_s / 1.25}, {37.0, decay_s / 1.65}};
  const SampledPlant plant = sampled_plant(outputs, inputs, modes, kSampleRateHz, 0.1);
  fmt::print("{} x {}, {} seeds, noise {}, decay {:.3f} s\n", outputs, inputs, seeds, noise,
             decay_s);
  const Record records[] = {
      {"orthogonal, two periods after one", AxisScheme::orthogonal, 3, {.transient_periods = 1}},
      {"zippered, one period after one", AxisScheme::zippered, 2, {.transient_periods = 1}},
      {"zippered, two periods after one", AxisScheme::zippered, 3, {.transient_periods = 1}},
      {"zippered, one period from rest, lpm", AxisScheme::zippered, 1, {.method = FrfMethod::lpm}}};
  for (const Record& record : records) {
    const LoopExperiment x = experiment(record, inputs);
    for (const Weighting weighting : {Weighting::noise_variance, Weighting::likelihood})
      print(record.what, to_string(weighting),
            repeat_fits(plant, modes, x, noise, record.options, weighting, seeds), seeds);
  }
  return 0;
}
