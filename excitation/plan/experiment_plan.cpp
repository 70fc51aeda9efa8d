#include "excitation/plan/experiment_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <set>
#include <stdexcept>

#include "excitation/multisine/line_spectrum.hpp"
#include "excitation/multisine/multisine_lines.hpp"
#include "excitation/multisine/random_stream.hpp"
#include "excitation/plan/hadamard_matrix.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

void check_axis(const FrequencyGrid& grid, const ExperimentSpec& spec, std::size_t number) {
  const ExcitationAxis& axis = spec.axes[number];
  const std::string place = fmt::format("experiment: axes[{}]", number);
  require(!axis.channel.empty(), "{}.channel: missing name", place);
  require(axis.level > 0.0 && std::isfinite(axis.level),
          "{}.level ({}): must be positive and finite; got {}", place, axis.channel, axis.level);
  const bool given = axis.phase_rad.size() > 0;
  require(!given || (axis.phase_rad.size() == grid.size() && axis.phase_rad.allFinite()),
          "{}.phase_rad ({}): has {} entries; expected one finite number per line ({})", place,
          axis.channel, axis.phase_rad.size(), grid.size());
  require(!given || spec.crest_iterations == 0,
          "{}.phase_rad ({}): given phases are not reduced; set crest_iterations to 0", place,
          axis.channel);
  if (axis.shape.size() == 0) return;
  require(axis.shape.size() == grid.size(),
          "{}.shape ({}): has {} entries; expected one per line ({})", place, axis.channel,
          axis.shape.size(), grid.size());
  for (Index k = 0; k < grid.size(); ++k) {
    if (!has_line(spec.scheme, static_cast<Index>(number), std::ssize(spec.axes), k)) continue;
    // An unexcited line has no FRF, so it must not be in the grid.
    require(
        axis.shape[k] > 0.0 && std::isfinite(axis.shape[k]),
        "{}.shape ({}): is {} at line {}; must be positive and finite on every line of the grid",
        place, axis.channel, axis.shape[k], grid.lines()[k]);
  }
}

void check(const FrequencyGrid& grid, const ExperimentSpec& spec) {
  const auto at_least = [](const char* field, int value, int least) {
    require(value >= least, "experiment: {} must be at least {}; got {}", field, least, value);
  };
  at_least("realizations", spec.realizations, 1);
  at_least("periods", spec.periods, 1);
  at_least("transient_periods", spec.transient_periods, 0);
  at_least("crest_iterations", spec.crest_iterations, 0);
  require(!spec.axes.empty(), "experiment: axes: at least one axis is required");
  require(spec.scheme != ExcitationScheme::zippered || grid.size() >= std::ssize(spec.axes),
          "experiment: scheme zippered distributes {} lines over {} axes, which is too few. "
          "Lengthen the period or widen the band",
          grid.size(), spec.axes.size());
  std::set<std::string> channels;
  for (std::size_t p = 0; p < spec.axes.size(); ++p) {
    check_axis(grid, spec, p);
    require(channels.insert(spec.axes[p].channel).second,
            "experiment: axes[{}].channel: duplicate channel '{}'", p, spec.axes[p].channel);
  }
}

/// T, axes x experiments: T T^H = n I for the orthogonal schemes, I for single_axis, one column of ones for one
/// experiment.
MatrixXcd mixing_matrix(ExcitationScheme scheme, int n) {
  if (scheme == ExcitationScheme::zippered || scheme == ExcitationScheme::simultaneous)
    return MatrixXcd::Ones(n, 1);
  if (scheme == ExcitationScheme::single_axis) return MatrixXcd::Identity(n, n);
  if (scheme == ExcitationScheme::orthogonal_hadamard) {
    try {
      return hadamard_matrix(n).cast<std::complex<double>>();
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(
          fmt::format("experiment: scheme orthogonal_hadamard with {} axes: {}. Use "
                      "orthogonal_dft, which supports any number",
                      n, e.what()));
    }
  }
  MatrixXcd T(n, n);
  for (long long p = 0; p < n; ++p) {
    for (long long e = 0; e < n; ++e) {
      const double turns = static_cast<double>(p * e % n) / n;
      T(static_cast<Index>(p), static_cast<Index>(e)) =
          std::polar(1.0, 2.0 * std::numbers::pi * turns);
    }
  }
  return T;
}

/// Amplitudes of rms 1 on the lines of the axis.
Eigen::VectorXd axis_amplitude(const FrequencyGrid& grid, const ExperimentSpec& spec, int axis) {
  Eigen::VectorXd shape = spec.axes[axis].shape;
  if (spec.scheme != ExcitationScheme::zippered) return unit_rms_amplitude(grid, shape);
  if (shape.size() == 0) shape.setOnes(grid.size());
  for (Index k = 0; k < grid.size(); ++k)
    if (!has_line(spec.scheme, axis, std::ssize(spec.axes), k)) shape[k] = 0.0;
  return unit_rms_amplitude(grid, shape);
}

/// Of one realization, axes x lines.
MatrixXd draw_phase_rad(const FrequencyGrid& grid, const ExperimentSpec& spec, int realization) {
  const int axes = static_cast<int>(spec.axes.size());
  MatrixXd phase_rad(axes, grid.size());
  for (int p = 0; p < axes; ++p) {
    const Eigen::VectorXd& given = spec.axes[p].phase_rad;
    if (given.size() > 0) {
      for (Index k = 0; k < grid.size(); ++k)
        phase_rad(p, k) = positive_phase_rad(std::polar(1.0, given[k]));
      continue;
    }
    const std::uint64_t seed = stream_seed(spec.seed, static_cast<std::uint64_t>(realization),
                                           static_cast<std::uint64_t>(p));
    phase_rad.row(p) =
        multisine_phase_rad(grid, axis_amplitude(grid, spec, p), seed, spec.crest_iterations)
            .transpose();
  }
  return phase_rad;
}

/// All phases of a plan with crest reduction, on all cores. Each realization is reduced separately, so the
/// result does not depend on the distribution over threads.
std::vector<MatrixXd> reduced_phases(const FrequencyGrid& grid, const ExperimentSpec& spec) {
  std::vector<MatrixXd> phases(spec.realizations);
  for_each_task(0, spec.realizations, [&](int m) { phases[m] = draw_phase_rad(grid, spec, m); });
  return phases;
}

}  // namespace

ExperimentPlan::ExperimentPlan(FrequencyGrid grid, ExperimentSpec spec)
    : ExperimentPlan(std::move(grid), std::move(spec), {}) {}

ExperimentPlan::ExperimentPlan(FrequencyGrid grid, ExperimentSpec spec,
                               std::vector<MatrixXd> phase_rad)
    : grid_(std::move(grid)), spec_(std::move(spec)), reduced_phase_rad_(std::move(phase_rad)) {
  check(grid_, spec_);
  mixing_ = mixing_matrix(spec_.scheme, axes());
  if (spec_.crest_iterations > 0 && reduced_phase_rad_.empty()) {
    reduced_phase_rad_ = reduced_phases(grid_, spec_);
  }
  set_amplitude();
}

std::vector<RunId> ExperimentPlan::runs() const {
  std::vector<RunId> runs;
  for (int m = 0; m < spec_.realizations; ++m) {
    for (int e = 0; e < experiments(); ++e) runs.push_back({m, e});
  }
  return runs;
}

std::vector<RunId> ExperimentPlan::runs_without(const std::vector<RunId>& done) const {
  std::vector<RunId> left = runs();
  std::erase_if(left, [&](RunId run) { return std::ranges::find(done, run) != done.end(); });
  return left;
}

long long ExperimentPlan::samples_per_run() const noexcept {
  const long long periods = static_cast<long long>(spec_.transient_periods) + spec_.periods;
  return periods * grid_.samples_per_period();
}

double ExperimentPlan::duration_s() const noexcept {
  return static_cast<double>(spec_.realizations) * experiments() *
         static_cast<double>(samples_per_run()) / grid_.sample_rate_hz();
}

void ExperimentPlan::check_run(RunId run) const {
  require(run.realization >= 0 && run.realization < spec_.realizations && run.experiment >= 0 &&
              run.experiment < experiments(),
          "experiment: unknown realization {}, experiment {}; realizations: {}, experiments: {}",
          run.realization, run.experiment, spec_.realizations, experiments());
}

MatrixXd ExperimentPlan::phase_rad(int realization) const {
  check_run({realization, 0});
  if (!reduced_phase_rad_.empty()) return reduced_phase_rad_[realization];
  return draw_phase_rad(grid_, spec_, realization);
}

MatrixXcd ExperimentPlan::spectrum(RunId run) const {
  check_run(run);
  return axis_coefficients(mixing_.col(run.experiment), amplitude_, phase_rad(run.realization));
}

MatrixXd ExperimentPlan::excitation(RunId run) const {
  const MatrixXcd lines = spectrum(run);
  LineSpectrum synthesis(grid_);
  MatrixXd samples = MatrixXd::Zero(grid_.samples_per_period(), axes());
  for (int p = 0; p < axes(); ++p) {
    if (excites(p, run.experiment)) samples.col(p) = synthesis.samples(lines.row(p).transpose());
  }
  return samples;
}

/// One amplitude for all runs, also when peaks are prescribed: the best linear approximation of a
/// slightly nonlinear stage depends on the amplitudes, so they must not change between realizations.
void ExperimentPlan::set_amplitude() {
  amplitude_.resize(axes(), grid_.size());
  Eigen::VectorXd level(axes());
  for (int p = 0; p < axes(); ++p) {
    amplitude_.row(p) = axis_amplitude(grid_, spec_, p).transpose();
    level[p] = spec_.axes[p].level;
  }
  if (spec_.scaling == AmplitudeScaling::peak) {
    Eigen::VectorXd peak = Eigen::VectorXd::Zero(axes());
    for (const RunId run : runs()) {
      peak = peak.cwiseMax(excitation(run).cwiseAbs().colwise().maxCoeff().transpose());
    }
    level.array() /= peak.array();
  }
  amplitude_ = level.asDiagonal() * amplitude_;
}

}  // namespace stageid
