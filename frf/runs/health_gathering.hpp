#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "frf/periods/start_transient.hpp"
#include "frf/runs/drive_mask.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Spectra of one period that its reader has already.
struct KnownSpectra {
  const Eigen::MatrixXcd& values;            ///< rows: sensors, then actuators, of these
  const std::vector<Eigen::Index>& sensors;  ///< positions in the log
  const std::vector<Eigen::Index>& actuators;
  const SpectrumLines& lines;  ///< columns
};

/// What one run gives to a HealthRecord.
class HealthPart {
 public:
  /// Before the run's periods. @param excitation samples x channels, one period
  void begin(const UsedRun& run, const Eigen::MatrixXd& excitation);
  /// After begin(): the transient of the start is looked at too, on these lines of these sensors. Reads
  /// the period before the used ones, if there is one.
  void watch_start(const UsedRun& run, const std::vector<int>& lines,
                   const std::vector<Eigen::Index>& sensors, RunWorkspace& workspace);
  /// The clean period in workspace.samples. Channels that are not known are transformed here.
  void take(RunWorkspace& workspace, const KnownSpectra* known);
  void leave_out();
  void note(const std::vector<SampleSlip>& slips) { slips_ = slips; }
  /// After the run's periods.
  void end();

 private:
  friend class HealthGathering;
  void transform_others(RunWorkspace& workspace, const std::vector<char>& is_known,
                        Eigen::MatrixXcd& Z) const;

  std::vector<int> lines_;  // empty: spectra of this run are not wanted
  std::vector<Eigen::MatrixXcd> periods_;
  std::vector<ChannelScan> scan_;
  std::vector<SampleSlip> slips_;
  DriveMask drive_;
  Eigen::Index sensors_ = 0;  // of the log
  StartRecorder recorder_;
  std::vector<int> start_lines_;
  std::vector<Eigen::Index> start_sensors_;
  int start_transient_periods_ = 0;
  RunStart start_;
};

/// A HealthRecord in the making, beside whatever else the logs are read for.
class HealthGathering {
 public:
  /// Spectra are those of the first complete realization, on at most kHealthLines lines.
  explicit HealthGathering(const std::vector<RealizationRuns>& realizations);

  /// Position of a run without a clean period in the realization that was excited last; beyond the
  /// last one if there is none.
  std::size_t first_without_spectra() const;

  /// Whether each run of the realization that was excited last gave spectra.
  bool complete() const;

  /// The excitation of the runs of a realization whose spectra are wanted, the earlier ones having
  /// lacked a run. Before a part of it is filled. @pre !complete()
  void excite(std::size_t realization, const std::vector<RunExcitation>& runs);

  /// Where run `experiment` of realization `realization` (positions) goes; different parts may be
  /// filled at once.
  HealthPart& part(std::size_t realization, std::size_t experiment);

  /// What the estimate shows beside.
  void note(const std::optional<ModeDrift>& drift, std::vector<NoisyRun> noisy_runs) {
    record_.drift = drift;
    record_.noisy_runs = std::move(noisy_runs);
  }

  /// After all parts are filled; once. @pre complete()
  HealthRecord finish();

 private:
  void add(HealthPart&& part);
  void add_start(HealthPart& part);

  std::vector<std::vector<HealthPart>> parts_;  // by realization and experiment
  std::vector<int> realization_;                // their numbers
  std::vector<HealthPart>* excited_ = nullptr;  // parts whose spectra are wanted
  std::vector<int> lines_;
  std::vector<int> start_lines_;  // of the first run that tells of its start
  HealthRecord record_;
};

}  // namespace stageid
