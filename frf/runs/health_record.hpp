#pragma once

#include <Eigen/Core>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/periods/actuator_step.hpp"
#include "frf/periods/estimate_results.hpp"
#include "frf/periods/sample_slip.hpp"
#include "frf/periods/start_transient.hpp"
#include "frf/response/frf_options.hpp"
#include "frf/runs/channel_scan.hpp"

namespace stageid {

/// Spectra (DFT / number of samples) of all channels of a log on one line, for all clean periods of all experiments
/// of one realization. An estimate leaves out those that differ from the others.
struct LineRecord {
  Eigen::MatrixXcd R;  ///< n_r x E: every excitation channel
  Eigen::MatrixXcd Z;  ///< [Y; U], n_y + n_u x columns: one per period, ordered by experiment
};

/// Spectra of one realization, on at most kHealthLines excited lines.
struct RealizationRecord {
  int realization = 0;
  std::vector<int> periods;        ///< number of clean ones, of each experiment
  Eigen::VectorXd frequency_hz;    ///< K: excited lines, a subset if there are many
  std::vector<LineRecord> lines;   ///< K
  std::vector<Eigen::Index> axes;  ///< excitation channels that are excited, ascending
  bool zippered = false;           ///< one experiment excites them all, each on its own lines

  Eigen::Index experiments() const noexcept { return std::ssize(periods); }
  /// Degrees of freedom of the scatter between periods: sum_e (P_e - 1).
  int scatter_dof() const noexcept;
  /// Mean over the periods of every experiment: rows x E.
  Eigen::MatrixXcd mean(const Eigen::MatrixXcd& columns) const;
  /// sum_e sum_p (X_pe - X_e)(X_pe - X_e)^H, with scatter_dof() degrees of freedom.
  Eigen::MatrixXcd scatter(const Eigen::MatrixXcd& columns) const;
  /// Variance E|dX|^2 of the mean over periods of each row, pooled over the experiments; zero with only one
  /// period.
  Eigen::VectorXd variance_of_mean(const Eigen::MatrixXcd& columns) const;
};

/// Input of the checks of a log's health. The spectra are those of the first complete realization.
struct HealthRecord : RealizationRecord, EstimateResults {
  LogInfo info;
  /// The other complete realizations, with at most kPeriodsOfOthers periods per run.
  std::vector<RealizationRecord> others;
  std::vector<ChannelScan> scan;    ///< [sensors; actuators], over all used runs
  RunHealth health;                 ///< over all used runs
  std::vector<SampleSlip> slips;    ///< of the same runs
  std::vector<ActuatorStep> steps;  ///< of the converters behind the records of the actuators
  StartEvidence start;              ///< of the start of the runs; empty if there is no evidence

  Eigen::Index n_y() const noexcept { return std::ssize(info.sensors); }
  Eigen::Index n_u() const noexcept { return std::ssize(info.actuators); }
};

/// Largest number of lines of the checks, sufficient for the rigid body and the modes.
inline constexpr Eigen::Index kHealthLines = 800;
/// Largest number of periods per run of the realizations after the first one. It limits the memory for them.
inline constexpr std::size_t kPeriodsOfOthers = 2;

/// Reads every clean period of the runs selected by FrfOptions. A realization is complete if all its runs have one.
/// Memory: one period per thread, and the spectra on at most kHealthLines lines per realization.
/// @throws the same as choose_runs() and LogReader::read(); FormatError if there is no such realization.
HealthRecord read_health_record(const std::vector<const LogReader*>& logs,
                                const FrfOptions& options);

}  // namespace stageid
