#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/multisine/frequency_grid.hpp"
#include "excitation/multisine/multisine.hpp"

namespace stageid {

/// How the axes share the experiments of one realization.
enum class ExcitationScheme : std::uint8_t {
  single_axis,     ///< experiment e excites axis e alone
  orthogonal_dft,  ///< all axes at once, axis p in experiment e times exp(2 pi j p e / n); any n
  orthogonal_hadamard,  ///< the same with a Hadamard matrix: n = 1, 2, 4, 8, 12, 16, 20 ...
  zippered  ///< one experiment: axis p has the p-th, (p + n)-th, (p + 2n)-th ... line for itself
};

/// One excited channel of the stage.
struct ExcitationAxis {
  std::string channel;         ///< actuator name
  double level = 1.0;          ///< rms or peak, unit of the channel
  Eigen::VectorXd shape = {};  ///< relative amplitude a line; empty: flat
};

struct ExperimentSpec {
  ExcitationScheme scheme = ExcitationScheme::single_axis;
  AmplitudeScaling scaling = AmplitudeScaling::rms;
  std::vector<ExcitationAxis> axes;  ///< one experiment per axis and realization (zippered: one)
  int realizations = 2;
  int periods = 2;            ///< measured periods of every run
  int transient_periods = 1;  ///< periods before them that are recorded and not used
  int crest_iterations = 0;
  std::uint64_t seed = 0;
};

/// Which realization and experiment one run belongs to (both 0-based).
struct RunId {
  int realization = 0;
  int experiment = 0;
  friend auto operator<=>(const RunId&, const RunId&) = default;
};

/// Whether axis p of n has line k (a position in the grid) for its own or shares it.
constexpr bool has_line(ExcitationScheme scheme, Eigen::Index p, Eigen::Index n, Eigen::Index k) {
  return scheme != ExcitationScheme::zippered || k % n == p;
}

/// The whole experiment: every run's multisines follow from it, on every machine the same.
///
/// Axis p of realization m is a multisine with line coefficients A_p(l) / 2 exp(j phi_mp(l)); its
/// amplitudes A_p are the same in all runs, its phases phi_mp come from a stream of their own and
/// are new in every realization. In experiment e it plays times T(p, e), see ExcitationScheme: per
/// line R R^H = n D_A^2 / 4 over the n experiments for the orthogonal schemes. Zippered axes have
/// A_p(l) = 0 on the lines of the others. With
/// AmplitudeScaling::rms, `level` is the rms of the axis in every run that excites it; with peak,
/// its largest absolute sample in all runs together.
class ExperimentPlan {
 public:
  /// Takes seconds per axis and realization if spec.crest_iterations > 0, else milliseconds.
  /// @throws std::invalid_argument naming the wrong field.
  ExperimentPlan(FrequencyGrid grid, ExperimentSpec spec);

  /// A plan whose phases are known already, one matrix (axes x lines, in [0, 2 pi)) a realization.
  /// @pre spec.crest_iterations > 0: with 0 the phases follow from the seed.
  /// @throws std::invalid_argument naming the wrong field.
  ExperimentPlan(FrequencyGrid grid, ExperimentSpec spec, std::vector<Eigen::MatrixXd> phase_rad);

  const FrequencyGrid& grid() const noexcept { return grid_; }
  const ExperimentSpec& spec() const noexcept { return spec_; }
  int axes() const noexcept { return static_cast<int>(spec_.axes.size()); }
  int experiments() const noexcept {
    return spec_.scheme == ExcitationScheme::zippered ? 1 : axes();
  }
  std::vector<RunId> runs() const;  ///< in the order of measuring: realization by realization
  /// runs() without those of `done`, for an experiment that is resumed.
  std::vector<RunId> runs_without(const std::vector<RunId>& done) const;
  long long samples_per_run() const noexcept;
  double duration_s() const noexcept;

  /// One period of the excitation of a run, samples_per_period x axes.
  /// @throws std::invalid_argument if the plan has no such run.
  Eigen::MatrixXd excitation(RunId run) const;

  /// Its spectrum R(l_k), axes x lines: coefficient of exp(j 2 pi l n / N), i.e. DFT / N.
  /// @throws std::invalid_argument if the plan has no such run.
  Eigen::MatrixXcd spectrum(RunId run) const;

  /// A_p(l_k), axes x lines, unit of the channel.
  const Eigen::MatrixXd& amplitude() const noexcept { return amplitude_; }
  /// T, axes x experiments; the identity for single_axis, ones for zippered.
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
  /// One matrix per realization if crest_iterations > 0, because reducing takes long; else empty,
  /// because drawing again is cheaper than keeping.
  std::vector<Eigen::MatrixXd> reduced_phase_rad_;
};

}  // namespace stageid
