#pragma once

#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/periods/actuator_step.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/frf_options.hpp"

namespace stageid {

/// What an estimate from the same runs has shown.
struct EarlierEstimate {
  std::vector<ActuatorStep> steps;     ///< the actuators' records become what was applied
  std::vector<DroppedPeriod> dropped;  ///< from the records as they are
};

/// One used run and its location.
struct UsedRun {
  const LogReader* log = nullptr;
  std::size_t index = 0;  ///< of the run in its log
  int transient_periods = 0;
  int periods = 0;                           ///< number recorded after the transient
  const EarlierEstimate* earlier = nullptr;  ///< applied by for_each_period()

  const LogRun& run() const { return log->runs()[index]; }
  std::string place() const;  ///< "file:/runs/0003", for messages
};

/// Number of discarded periods: the requested one, otherwise the log's own, or 0 if the transient is modelled.
int transient_periods(const LogInfo& info, const FrfOptions& options);

/// The runs of one realization, by experiment.
struct RealizationRuns {
  int realization = 0;
  std::vector<UsedRun> runs;
};

/// The used runs and the incomplete realizations.
struct ChosenRuns {
  std::vector<RealizationRuns> realizations;
  std::vector<LeftOutRealization> incomplete;  ///< with the missing experiment; ascending
};

/// Selects complete runs of the requested realizations; of several runs of one (realization, experiment), the last.
/// By default, all realizations that have every experiment begun in any of them; the others are listed as incomplete.
/// Ordered by realization and experiment, for any order in the logs.
///
/// @throws std::invalid_argument if the logs disagree in rate, period or channels, a requested realization is missing,
///         or nothing is complete; FormatError if a run is not a whole number of periods or has none after the
///         transient.
ChosenRuns choose_runs(const std::vector<const LogReader*>& logs, const FrfOptions& options);

}  // namespace stageid
