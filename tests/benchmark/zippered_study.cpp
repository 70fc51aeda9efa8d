// Results of one experiment with zippered lines: every axis has every n-th line.
//
//   zippered_study variance [seeds = 30] [outputs = 4] [inputs = 13]
//   zippered_study resonance [seeds = 200]
//   zippered_study plants [plants = 12] [seeds = 20] [outputs = 2] [inputs = 2] [noise = 0.1]
//   zippered_study time [seeds = 10]
//
// variance: stated over empirical variance, and the squared mean error over the variance of that mean
//   (1: unbiased), for a record of one period from rest (lpm), for one period after a skipped one
//   (noise from the residual of the local models), and for two (noise from the periods).
// resonance: a mode of half-power width w in distances of an axis' own lines, 2 x 2, around its
//   resonance: bias over stated standard deviation, and the fraction of experiments in which the check
//   of the interpolation reports a finding.
// plants: the same two variances on random plants, over all of them and on the worst and best one, and the
//   stated noise (C_E) over the true one; lpm adds the noise of its transient model.
// time: the error of one zippered period against the orthogonal scheme in the same measuring time, on
//   resonances and between them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <vector>

#include "excitation/decompositions/decompositions.hpp"
#include "frf/health/estimate_check.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/models/estimate_trials.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

constexpr double kSampleRateHz = 200.0;
constexpr double kNoise = 0.1;
constexpr double kLineDistanceHz = 0.5;  // of an axis

/// One period in which each axis has lines 0.5 Hz apart, odd ones.
LoopExperiment zippered(int axes) {
  LoopExperiment x{.sample_rate_hz = kSampleRateHz, .period_samples = 800 * axes, .axes = axes};
  x.lines = line_range(36 * axes + 1, 160 * axes + 1, 2);
  x.periods = 1;
  x.transient_periods = 0;
  x.scheme = AxisScheme::zippered;
  return x;
}

void print(const char* what, const Trials& trials) {
  fmt::print(
      "  {:34} stated / empirical variance {:.3f}, squared bias / its variance {:.3f}, error "
      "{:.2e}\n",
      what, 1.0 / trials.over_stated, trials.bias, trials.error);
}

void study_variance(int seeds, int outputs, int inputs) {
  const SampledPlant plant =
      sampled_plant(outputs, inputs, {{12.3, 0.1}, {24.0, 0.08}, {37.0, 0.06}}, kSampleRateHz, 0.1);
  LoopExperiment x = zippered(inputs);
  fmt::print("{} x {}, {} lines, half-power widths 6.4, 8.0, 10.6 times an axis' line distance\n",
             outputs, inputs, x.lines.size());
  print("one period from rest, lpm", repeat(plant, x, kNoise, {.method = FrfMethod::lpm}, seeds));
  x.periods = 2;
  print("one period after one passed over",
        repeat(plant, x, kNoise, {.transient_periods = 1}, seeds));
  x.periods = 3;
  print("two periods after one passed over",
        repeat(plant, x, kNoise, {.transient_periods = 1}, seeds));
}

/// Three to six modes anywhere in the band, 2 to 12 distances of an axis' lines wide; stable in the loop.
SampledPlant random_plant(int outputs, int inputs, std::uint64_t seed) {
  ComplexNoise random(seed);
  for (;;) {
    std::vector<PlantMode> modes(3 + static_cast<std::size_t>(4.0 * random.uniform()));
    for (PlantMode& mode : modes) {
      const double width_hz = kLineDistanceHz * 2.0 * std::pow(6.0, random.uniform());
      mode = {9.0 + 31.0 * random.uniform(), 1.0 / (std::numbers::pi * width_hz)};
    }
    const SampledPlant plant = sampled_plant(outputs, inputs, modes, kSampleRateHz, 0.1);
    const Eigen::MatrixXd closed = plant.A - plant.B * plant.K * plant.C;
    if (eigenvalues(closed).cwiseAbs().maxCoeff() < 0.995) return plant;
  }
}

void study_plants(int plants, int seeds, int outputs, int inputs, double noise) {
  struct Record {
    const char* what;
    int periods;
    FrfOptions options;
  };
  fmt::print("{} x {}, {} plants, noise {}\n", outputs, inputs, plants, noise);
  for (const Record& record :
       {Record{"one period from rest, lpm", 1, {.method = FrfMethod::lpm}},
        Record{"one period after one passed over", 2, {.transient_periods = 1}},
        Record{"two periods after one passed over", 3, {.transient_periods = 1}}}) {
    LoopExperiment x = zippered(inputs);
    x.periods = record.periods;
    double over = 0.0, bias = 0.0, noise_ratio = 0.0;
    double least = 1e9, most = 0.0;
    for (int p = 1; p <= plants; ++p) {
      const Trials trials =
          repeat(random_plant(outputs, inputs, 1000 + static_cast<std::uint64_t>(p)), x, noise,
                 record.options, seeds);
      over += trials.over_stated / plants;
      bias += (trials.bias - 1.0) / seeds / plants;
      least = std::min(least, 1.0 / trials.over_stated);
      most = std::max(most, 1.0 / trials.over_stated);
      const int used = record.periods - record.options.transient_periods.value_or(0);
      noise_ratio += trials.residual / (noise * noise / x.period_samples / used) / plants;
    }
    fmt::print(
        "  {:34} stated / empirical variance {:.3f} ({:.3f} ... {:.3f}), of which bias {:.3f}; "
        "noise stated / true {:.3f}\n",
        record.what, 1.0 / over, least, most, bias, noise_ratio);
  }
}

/// Around the middle of three modes, as wide as `width` distances of an axis' lines (0.5 Hz).
void study_resonance(int seeds) {
  constexpr double kModeHz = 24.3;
  for (const double width : {0.5, 1.0, 1.5, 2.0, 4.0}) {
    const double width_hz = 0.5 * width;
    const SampledPlant plant = sampled_plant(
        2, 2, {{12.3, 0.1}, {kModeHz, 1.0 / (std::numbers::pi * width_hz)}, {37.0, 0.05}},
        kSampleRateHz, 0.05);
    const double reach_hz = std::max(width_hz, 0.5);
    LoopExperiment x = zippered(2);
    x.periods = 4;
    Eigen::MatrixXcd sum;
    Eigen::ArrayXXd squares, stated;
    double relative = 0.0;
    int found = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      x.seed = static_cast<std::uint64_t>(seed);
      const MemoryLog log = simulate_sampled_log(plant, x, kNoise);
      const FrfEstimate frf = estimate_plant_frf({&log}, {.transient_periods = 2});
      found += check_interpolation(frf).empty() ? 0 : 1;
      const FrfEstimate near = select_band(frf, kModeHz - reach_hz, kModeHz + reach_hz);
      if (seed == 1) {
        sum.setZero(4, near.lines());
        squares = stated = Eigen::ArrayXXd::Zero(4, near.lines());
      }
      for (Eigen::Index k = 0; k < near.lines(); ++k) {
        const Eigen::MatrixXcd G = plant.response(near.omega_rad_s()[k], kSampleRateHz);
        const Eigen::VectorXcd error = (near.at(k) - G).reshaped();
        sum.col(k) += error;
        squares.col(k) += error.array().abs2();
        relative += (near.noise_variance.col(k).array() / G.reshaped().array().abs2()).mean();
      }
      stated += near.noise_variance.array();
    }
    const Eigen::ArrayXXd bias = (sum / seeds).cwiseAbs2().array() * seeds / stated;
    const double lines = static_cast<double>(sum.cols()) * seeds;
    fmt::print(
        "  width {:3.1f}: bias / standard deviation {:.2f} (rms, {:.2f} by chance), {:.2f} at "
        "most; stated / empirical variance {:.3f}; relative standard deviation {:.1e}; "
        "reported {:.0f} %\n",
        width, std::sqrt(bias.mean()), 1.0 / std::sqrt(seeds), std::sqrt(bias.maxCoeff()),
        1.0 / (squares / stated).mean(), std::sqrt(relative / lines), 100.0 * found / seeds);
  }
}

/// Relative errors within two half-power widths of a resonance, and elsewhere.
struct Errors {
  double near = 0.0;
  double far = 0.0;
};

Errors errors(const SampledPlant& plant, const std::vector<PlantMode>& modes, LoopExperiment x,
              const FrfOptions& options, int seeds) {
  double sums[2] = {0.0, 0.0};
  double counts[2] = {0.0, 0.0};
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = simulate_sampled_log(plant, x, kNoise);
    const FrfEstimate frf = estimate_plant_frf({&log}, options);
    for (Eigen::Index k = 0; k < frf.lines(); ++k) {
      const double f = frf.frequency_hz[k];
      const bool near = std::any_of(modes.begin(), modes.end(), [f](const auto& mode) {
        return std::abs(f - mode.frequency_hz) < 2.0 / (std::numbers::pi * mode.decay_s);
      });
      const Eigen::MatrixXcd G = plant.response(frf.omega_rad_s()[k], kSampleRateHz);
      sums[near ? 0 : 1] += (frf.at(k) - G).squaredNorm() / G.squaredNorm();
      counts[near ? 0 : 1] += 1.0;
    }
  }
  return {std::sqrt(sums[0] / counts[0]), std::sqrt(sums[1] / counts[1])};
}

/// The same excited time, and the same rms of every actuator: 4 experiments of one period and a
/// transient one with lines 0.5 Hz apart, against one period of four times the length, from rest.
void study_time(int seeds) {
  constexpr int kAxes = 4;
  for (const double decay_s : {0.2, 0.5, 2.0}) {
    const std::vector<PlantMode> modes = {
        {12.3, decay_s}, {17.0, 0.8 * decay_s}, {37.0, 0.5 * decay_s}};
    const SampledPlant plant = sampled_plant(4, kAxes, modes, kSampleRateHz, 0.05);
    LoopExperiment zipped = zippered(kAxes);
    const double seconds = zipped.period_samples / kSampleRateHz;
    fmt::print("decay {:.1f} s: half-power widths {:.2g} ... {:.2g} times an axis' line distance\n",
               decay_s, 2.0 / (std::numbers::pi * decay_s), 4.0 / (std::numbers::pi * decay_s));
    const auto tell = [&](const char* what, double time_s, const Errors& e) {
      fmt::print("  {:40} {:5.0f} s: error {:.2e} near resonances, {:.2e} elsewhere\n", what,
                 time_s, e.near, e.far);
    };
    tell("zippered, one period from rest, lpm", seconds,
         errors(plant, modes, zipped, {.method = FrfMethod::lpm}, seeds));
    LoopExperiment all = zipped;
    all.scheme = AxisScheme::orthogonal;
    all.period_samples = 800;
    all.lines = line_range(37, 161, 2);
    tell("orthogonal, one period each, lpm", seconds,
         errors(plant, modes, all, {.method = FrfMethod::lpm}, seeds));
    all.periods = 2;
    tell("orthogonal, one period after another", 2.0 * seconds,
         errors(plant, modes, all, {.transient_periods = 1}, seeds));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments number(argc, argv);
  const std::string_view what = number.word(1, "variance");
  if (what == "variance") study_variance(number(2, 30), number(3, 4), number(4, 13));
  if (what == "resonance") study_resonance(number(2, 200));
  if (what == "plants")
    study_plants(number(2, 12), number(3, 20), number(4, 2), number(5, 2), number(6, kNoise));
  if (what == "time") study_time(number(2, 10));
  return 0;
}
