#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/multisine/frequency_grid.hpp"
#include "excitation/multisine/multisine.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

/// How the axes share the experiments of one realization.
enum class ExcitationScheme : std::uint8_t {
  single_axis,     ///< experiment e excites axis e alone
  orthogonal_dft,  ///< all axes at once, axis p in experiment e times exp(2 pi j p e / n); any n
  orthogonal_hadamard,  ///< the same with a Hadamard matrix: n = 1, 2, 4, 8, 12, 16, 20 ...
  zippered,             ///< one experiment: axis p has the p-th, (p + n)-th, (p + 2n)-th ... line
  simultaneous  ///< one experiment: all axes at once; it determines no response, but the changes of a model
};
template <>
inline constexpr std::array kWords<ExcitationScheme> = {
    "single_axis", "orthogonal_dft", "orthogonal_hadamard", "zippered", "simultaneous"};

/// One excited channel of the stage.
struct ExcitationAxis {
  std::string channel;             ///< actuator name
  double level = 1.0;              ///< rms or peak, unit of the channel
  Eigen::VectorXd shape = {};      ///< relative amplitude per line; empty: flat
  Eigen::VectorXd phase_rad = {};  ///< per line, in all realizations; empty: random
};

struct ExperimentSpec {
  ExcitationScheme scheme = ExcitationScheme::single_axis;
  AmplitudeScaling scaling = AmplitudeScaling::rms;
  /// One experiment per axis and realization (zippered, simultaneous: one).
  std::vector<ExcitationAxis> axes;
  int realizations = 2;
  int periods = 2;            ///< measured periods of every run
  int transient_periods = 1;  ///< discarded periods before the measured ones
  int crest_iterations = 0;
  std::uint64_t seed = 0;
};

/// Which realization and experiment one run belongs to (both 0-based).
struct RunId {
  int realization = 0;
  int experiment = 0;
  friend auto operator<=>(const RunId&, const RunId&) = default;
};

/// Whether axis p of n excites line k (an index into the grid).
constexpr bool has_line(ExcitationScheme scheme, Eigen::Index p, Eigen::Index n, Eigen::Index k) {
  return scheme != ExcitationScheme::zippered || k % n == p;
}

/// The whole experiment. The multisines of all runs follow from it, identically on every machine.
///
/// Axis p of realization m is a multisine with line coefficients A_p(l) / 2 exp(j phi_mp(l)). The amplitudes
/// A_p are the same in all runs. The phases phi_mp are drawn from a separate stream and are new in every
/// realization. In experiment e they are multiplied by T(p, e), see ExcitationScheme. For the orthogonal
/// schemes R R^H = n D_A^2 / 4 per line over the n experiments. Zippered axes have A_p(l) = 0 on the lines of
/// the other axes. `level` is the rms of the axis in every run that excites it (AmplitudeScaling::rms), or
/// its largest absolute sample in all runs (peak).
class ExperimentPlan {
 public:
  /// Takes seconds per axis and realization if spec.crest_iterations > 0, otherwise milliseconds.
  /// @throws std::invalid_argument naming the invalid field.
  ExperimentPlan(FrequencyGrid grid, ExperimentSpec spec);

  /// A plan with given phases, one matrix (axes x lines, in [0, 2 pi)) per realization.
  /// @pre spec.crest_iterations > 0: with 0 the phases follow from the seed.
  /// @throws std::invalid_argument naming the invalid field.
  ExperimentPlan(FrequencyGrid grid, ExperimentSpec spec, std::vector<Eigen::MatrixXd> phase_rad);

  const FrequencyGrid& grid() const noexcept { return grid_; }
  const ExperimentSpec& spec() const noexcept { return spec_; }
  int axes() const noexcept { return static_cast<int>(spec_.axes.size()); }
  int experiments() const noexcept { return static_cast<int>(mixing_.cols()); }
  std::vector<RunId> runs() const;  ///< in order of measurement: realization by realization
  /// runs() without `done`, to resume an experiment.
  std::vector<RunId> runs_without(const std::vector<RunId>& done) const;
  long long samples_per_run() const noexcept;
  double duration_s() const noexcept;

  /// One period of the excitation of a run, samples_per_period x axes.
  /// @throws std::invalid_argument if the run is not in the plan.
  Eigen::MatrixXd excitation(RunId run) const;

  /// Its spectrum R(l_k), axes x lines: coefficient of exp(j 2 pi l n / N), i.e. DFT / N.
  /// @throws std::invalid_argument if the run is not in the plan.
  Eigen::MatrixXcd spectrum(RunId run) const;

  /// A_p(l_k), axes x lines, unit of the channel.
  const Eigen::MatrixXd& amplitude() const noexcept { return amplitude_; }
  /// T, axes x experiments; the identity for single_axis, ones for zippered and simultaneous.
  const Eigen::MatrixXcd& mixing() const noexcept { return mixing_; }
  /// phi_mp(l_k) of a realization, axes x lines, in [0, 2 pi).
  Eigen::MatrixXd phase_rad(int realization) const;

 private:
  bool excites(int axis, int experiment) const { return mixing_(axis, experiment) != 0.0; }
  void check_run(RunId run) const;
  void set_amplitude();

  FrequencyGrid grid_;
  ExperimentSpec spec_;
  Eigen::MatrixXcd mixing_;
  Eigen::MatrixXd amplitude_;
  /// One matrix per realization if crest_iterations > 0, because the reduction takes long. Otherwise empty,
  /// because the phases are cheap to draw again.
  std::vector<Eigen::MatrixXd> reduced_phase_rad_;
};

}  // namespace stageid
