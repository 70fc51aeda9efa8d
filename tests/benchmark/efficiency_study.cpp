// Compares the scatter of fits with the reported deviations and with the Cramer-Rao bound. One 4 x 13 stage of 17
// modes with close pairs, measured many times.
//
//   efficiency_study [runs = 200] [degrees of freedom of the variances = 0: exactly known]
//                    [threads = 0: all] [residue rank = 0: free] [blind fits = 3]
//                    [first noise seed = 1] [stage seed = 5]
//
// Prints a line per mode: scatter over the reported standard deviation with the 95 % chi-square interval
// of that ratio around 1, coverage of 95 % intervals, and scatter over the Cramer-Rao bound (of free
// residues); then all of them together. Runs start from the truth; the first ones are repeated from
// nothing, and must end at the same minimum.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/models/cramer_rao_bound.hpp"
#include "tests/support/models/model_blind_fit.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

struct Request {
  Arguments argument;
  int runs = std::max(2, argument(1, 200));
  double dof = argument(2, 0.0);
  int threads = argument(3, 0);
  int rank = argument(4, 0);
  int blind_fits = argument(5, 3);
  std::uint64_t first_seed = argument(6, std::uint64_t{1});
  std::uint64_t stage_seed = argument(7, std::uint64_t{5});
};

RandomStage make_stage(std::uint64_t seed) {
  RandomStageSpec spec;
  spec.least_modes = spec.most_modes = 17;
  spec.least_noise_db = spec.most_noise_db = -50.0;
  return draw_random_stage(seed, spec);
}

/// Another measurement of the same stage.
void measure_again(RandomStage& stage, const Request& request, int run) {
  RandomNumbers random(request.first_seed + 1000003ULL * static_cast<unsigned>(run));
  stage.frf.noise_dof = request.dof;
  for (Eigen::Index k = 0; k < stage.exact.cols(); ++k)
    for (Eigen::Index c = 0; c < stage.exact.rows(); ++c) {
      const double variance = stage.variance(c, k);
      stage.frf.response(c, k) = stage.exact(c, k) + std::sqrt(variance) * random.circular();
      stage.frf.noise_variance(c, k) =
          request.dof > 0.0 ? variance * random.chi_square_mean(request.dof) : variance;
    }
}

FitOptions fit_options(const RandomStage& stage, const Request& request) {
  FitOptions options;
  options.weighting = Weighting::noise_variance;
  options.hold = HoldModel::exact;
  options.delay = DelayModel::estimate;
  options.delay_s = stage.delay_s;
  options.threads = request.threads;
  options.residue_rank = request.rank;
  options.rigid_body_rank = request.rank > 0 ? 3 : 0;
  return options;
}

/// One number of a mode over the runs.
struct Quantity {
  double truth = 0.0;
  double bound = 0.0;
  std::vector<double> errors;
  std::vector<double> reported;

  void add(double value, double deviation) {
    errors.push_back(value - truth);
    reported.push_back(deviation);
  }
  double runs() const { return static_cast<double>(errors.size()); }
  double mean_error() const {
    double sum = 0.0;
    for (const double e : errors) sum += e;
    return sum / runs();
  }
  double scatter() const {
    const double mean = mean_error();
    double sum = 0.0;
    for (const double e : errors) sum += (e - mean) * (e - mean);
    return std::sqrt(sum / (runs() - 1.0));
  }
  double over_reported() const {
    double sum = 0.0;
    for (const double d : reported) sum += d * d;
    return scatter() / std::sqrt(sum / runs());
  }
  double coverage() const {
    int inside = 0;
    for (std::size_t i = 0; i < errors.size(); ++i)
      inside += std::abs(errors[i]) < 1.959964 * reported[i] ? 1 : 0;
    return inside / runs();
  }
  double bias_in_its_error() const { return mean_error() / scatter() * std::sqrt(runs()); }
};

struct Mode {
  Quantity frequency;
  Quantity damping;
};

std::vector<Mode> modes_of(const RandomStage& stage) {
  const CramerRaoBound bound =
      cramer_rao_bound(stage.truth, stage.frf.frequency_hz, HoldModel::exact, stage.variance);
  std::vector<Mode> modes;
  for (std::size_t i = 0; i < stage.truth.submodels.size(); ++i) {
    const Submodel& s = stage.truth.submodels[i];
    if (!s.is_mode()) continue;
    const auto at = static_cast<Eigen::Index>(i);
    modes.push_back({{s.natural_frequency_hz(), bound.frequency_std_hz[at], {}, {}},
                     {s.damping_ratio(), bound.damping_std[at], {}, {}}});
  }
  return modes;
}

/// Adds a fit's modes. @returns false if it has no complete standard deviations.
bool add(const FitResult& fit, std::vector<Mode>& modes) {
  std::size_t mode = 0;
  for (const Submodel& s : fit.model.submodels) {
    if (!s.is_mode()) continue;
    if (!s.natural_frequency_std_hz || !s.damping_ratio_std || mode >= modes.size()) return false;
    modes[mode].frequency.add(s.natural_frequency_hz(), *s.natural_frequency_std_hz);
    modes[mode].damping.add(s.damping_ratio(), *s.damping_ratio_std);
    ++mode;
  }
  return mode == modes.size();
}

/// Largest difference of two fits' frequencies and damping ratios in standard deviations; negative if
/// they do not have the same number of modes.
double difference(const AdditiveModel& one, const AdditiveModel& other) {
  std::vector<const Submodel*> lists[2];
  for (int side = 0; side < 2; ++side)
    for (const Submodel& s : (side == 0 ? one : other).submodels)
      if (s.is_mode()) lists[side].push_back(&s);
  if (lists[0].size() != lists[1].size()) return -1.0;
  double largest = 0.0;
  for (std::size_t i = 0; i < lists[0].size(); ++i) {
    const Submodel& a = *lists[0][i];
    const Submodel& b = *lists[1][i];
    largest = std::max(
        {largest,
         std::abs(a.natural_frequency_hz() - b.natural_frequency_hz()) /
             a.natural_frequency_std_hz.value_or(1e-300),
         std::abs(a.damping_ratio() - b.damping_ratio()) / a.damping_ratio_std.value_or(1e-300)});
  }
  return largest;
}

/// sqrt(chi^2 / dof) at a normal quantile (Wilson and Hilferty).
double chi_quantile(double dof, double normal) {
  const double spread = 2.0 / (9.0 * dof);
  return std::pow(1.0 - spread + normal * std::sqrt(spread), 1.5);
}

/// Probability that a ratio of standard deviations over `runs` runs lies outside 0.9 to 1.1 by chance.
double outside_by_chance(double runs) {
  const double spread = 2.0 / (9.0 * (runs - 1.0));
  const auto normal = [&](double ratio) {
    return (std::pow(ratio, 2.0 / 3.0) - 1.0 + spread) / std::sqrt(spread);
  };
  return 0.5 * std::erfc(-normal(0.9) / std::sqrt(2.0)) +
         0.5 * std::erfc(normal(1.1) / std::sqrt(2.0));
}

void print_modes(const std::vector<Mode>& modes) {
  fmt::print(
      "                      scatter / reported   coverage of 95 %     scatter / bound      "
      "bias / its error\n"
      "  f/Hz      damping   frequency  damping   frequency  damping   frequency  damping   "
      "frequency  damping\n");
  for (const auto& [f, z] : modes)
    fmt::print(
        "{:9.3f}  {:8.5f}  {:9.3f}{:9.3f}  {:9.1f} %{:7.1f} %  {:9.3f}{:9.3f}  {:9.2f}{:9.2f}\n",
        f.truth, z.truth, f.over_reported(), z.over_reported(), 100.0 * f.coverage(),
        100.0 * z.coverage(), f.scatter() / f.bound, z.scatter() / z.bound, f.bias_in_its_error(),
        z.bias_in_its_error());
}

void print_summary(const std::vector<Mode>& modes) {
  std::vector<const Quantity*> all;
  for (const Mode& mode : modes) {
    all.push_back(&mode.frequency);
    all.push_back(&mode.damping);
  }
  const double runs = all[0]->runs();
  const auto count = static_cast<double>(all.size());
  const double low = chi_quantile(runs - 1.0, -1.959964);
  const double high = chi_quantile(runs - 1.0, 1.959964);
  double coverage = 0.0;
  double worst_bound = 0.0;
  double square_ratio = 0.0;
  double square_bound = 0.0;
  int outside_tenth = 0;
  int outside_interval = 0;
  for (const Quantity* q : all) {
    const double ratio = q->over_reported();
    const double bound = q->scatter() / q->bound;
    coverage += q->coverage() / count;
    worst_bound = std::max(worst_bound, bound);
    square_ratio += ratio * ratio / count;
    square_bound += bound * bound / count;
    outside_tenth += ratio < 0.9 || ratio > 1.1 ? 1 : 0;
    outside_interval += ratio < low || ratio > high ? 1 : 0;
  }
  fmt::print(
      "scatter / reported, all: {:.4f} +- {:.4f}; {} of {:.0f} outside 0.9 to 1.1 (by chance "
      "{:.2f}), {} outside the chi-square interval {:.3f} to {:.3f} (by chance {:.1f})\n",
      std::sqrt(square_ratio), 1.0 / std::sqrt(2.0 * runs * count), outside_tenth, count,
      count * outside_by_chance(runs), outside_interval, low, high, 0.05 * count);
  fmt::print("coverage, all: {:.2f} % +- {:.2f} %\n", 100.0 * coverage,
             100.0 * std::sqrt(0.95 * 0.05 / (runs * count)));
  fmt::print("scatter / bound, all: {:.4f}, largest {:.3f}\n", std::sqrt(square_bound),
             worst_bound);
}

}  // namespace

int main(int argc, char** argv) {
  const Request request{{argc, argv}};
  RandomStage stage = make_stage(request.stage_seed);
  fmt::print("{}\n{} runs, variances of {} degrees of freedom (0: exact), residue rank {}\n",
             stage.description(), request.runs, request.dof, request.rank);
  std::vector<Mode> modes = modes_of(stage);
  const FitOptions options = fit_options(stage, request);
  for (int run = 0; run < request.runs; ++run) {
    measure_again(stage, request, run);
    const FitResult fit = fit_additive_model(stage.frf, stage.truth, options);
    if (!fit.trustworthy() || !add(fit, modes)) {
      fmt::print("run {}: {} ({})\n", run, to_string(fit.status()), fit.message());
      return 1;
    }
    if (run >= request.blind_fits || request.rank > 0) continue;
    const BlindFit blind = fit_blind(stage, request.threads);
    fmt::print("run {} from nothing: {} modes, at most {:.2g} standard deviations away\n", run,
               blind.found_modes, difference(fit.model, blind.blind.model));
    std::fflush(stdout);
  }
  print_modes(modes);
  print_summary(modes);
  return 0;
}
