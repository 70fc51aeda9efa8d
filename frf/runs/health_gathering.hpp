#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "frf/periods/start_transient.hpp"
#include "frf/runs/drive_mask.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/runs/run_periods.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Spectra of one period that the caller has computed already.
struct KnownSpectra {
  const Eigen::MatrixXcd& values;            ///< rows: these sensors, then these actuators
  const std::vector<Eigen::Index>& sensors;  ///< indices in the log
  const std::vector<Eigen::Index>& actuators;
  const SpectrumLines& lines;  ///< columns
};

/// Contribution of one run to a HealthRecord.
class HealthPart {
 public:
  /// Call before read_periods() to examine the transient of the start on these lines of these sensors. Reads the last
  /// period before the used ones, if there is one.
  void watch_start(const UsedRun& run, const std::vector<int>& lines,
                   const std::vector<Eigen::Index>& sensors, RunWorkspace& workspace);

  /// Call after read_periods(): periods that differ from the others are no evidence about wiring and drift. The last one
  /// is kept in any case. What is known of the start's transient is kept if only the first periods were dropped.
  void forget_deviating(const RunSpectra& run);

  /// Packs or unpacks what a filled part contains.
  friend void carry(Parcel& parcel, HealthPart& part);

 private:
  friend class HealthGathering;
  friend void read_periods(const UsedRun& run, const Eigen::MatrixXd& excitation,
                           RunWorkspace& workspace, HealthPart* health, const ReadDone& read_done,
                           const std::function<const KnownSpectra*(int period)>& take,
                           const LeaveOut& leave_out);
  void begin(const UsedRun& run, const Eigen::MatrixXd& excitation);
  /// Adds the clean period in workspace.samples. Channels that are not in `known` are transformed here.
  void take(int period, RunWorkspace& workspace, const KnownSpectra* known);
  void leave_out();
  void end();

  std::vector<int> lines_;  // empty: no spectra of this run are needed
  std::size_t most_periods_ = std::numeric_limits<std::size_t>::max();  // whose spectra are kept
  std::vector<Eigen::MatrixXcd> periods_;
  std::vector<int> numbers_;  // of these periods
  std::vector<ChannelScan> scan_;
  std::vector<SampleSlip> slips_;
  DriveMask drive_;
  Eigen::Index sensors_ = 0;  // number of sensors of the log
  StartRecorder recorder_;
  std::vector<int> start_lines_;
  std::vector<Eigen::Index> start_sensors_;
  int start_transient_periods_ = 0;
  RunStart start_;
};

/// The same as for_each_period(); `health`, if not null, receives the periods as well. take() returns the spectra of the
/// period, or null.
/// @param excitation samples x channels, one period
void read_periods(const UsedRun& run, const Eigen::MatrixXd& excitation, RunWorkspace& workspace,
                  HealthPart* health, const ReadDone& read_done,
                  const std::function<const KnownSpectra*(int period)>& take,
                  const LeaveOut& leave_out);

/// A HealthRecord in progress, filled while the logs are read for another purpose.
class HealthGathering {
 public:
  explicit HealthGathering(const std::vector<RealizationRuns>& realizations);

  /// Index of the first run without spectra in the realization that was excited last; the number of runs if there is
  /// none.
  std::size_t first_without_spectra() const;

  /// Whether a realization is complete: each of its runs has spectra.
  bool complete() const;

  /// Sets the excitation of a realization. Call it before a part of the realization is filled; parts of the earlier
  /// ones are filled, unless one of them is complete().
  void excite(std::size_t realization, const std::vector<RunExcitation>& runs);

  /// The part for run `experiment` of realization `realization` (indices); different parts may be filled
  /// concurrently.
  HealthPart& part(std::size_t realization, std::size_t experiment);

  /// Adds results that only the estimate provides.
  void note(EstimateResults results) {
    static_cast<EstimateResults&>(record_) = std::move(results);
  }

  /// Call once, after all parts are filled. @pre complete()
  HealthRecord finish();

 private:
  struct Realization {
    std::vector<HealthPart> parts;  // one per experiment
    RealizationRecord record;
    std::vector<int> lines;  // empty: not excited
    std::size_t first_without_spectra() const;
    bool complete() const { return !lines.empty() && first_without_spectra() == parts.size(); }
  };

  void add(HealthPart& part);
  void add_start(HealthPart& part);

  std::vector<Realization> realizations_;
  std::size_t excited_ = 0;       // the last one whose excitation was set
  std::vector<int> start_lines_;  // of the first run with evidence about its start
  HealthRecord record_;
};

}  // namespace stageid
