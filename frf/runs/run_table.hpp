#pragma once

#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/response/frf_options.hpp"

namespace stageid {

/// One run that is used, and where it stands.
struct UsedRun {
  const LogReader* log = nullptr;
  std::size_t index = 0;  ///< of the run in its log
  int transient_periods = 0;
  int periods = 0;  ///< recorded after the transient

  const LogRun& run() const { return log->runs()[index]; }
  std::string place() const;  ///< "file:/runs/0003", for messages
};

/// Periods that are passed over: those asked for, else the log's own, or none if the transient is
/// modelled.
int transient_periods(const LogInfo& info, const FrfOptions& options);

/// The runs of one realization, by experiment.
struct RealizationRuns {
  int realization = 0;
  std::vector<UsedRun> runs;
};

/// What is estimated from, and what is not though it was begun.
struct ChosenRuns {
  std::vector<RealizationRuns> realizations;
  std::vector<LeftOutRealization> incomplete;  ///< and which experiment is missing; ascending
};

/// Chooses the runs: complete ones, of several of one (realization, experiment) the last, of the
/// realizations asked for; without a wish, of those that lack no experiment which was begun
/// anywhere; the others are told as incomplete. Ordered by realization and experiment, whatever their order in the logs.
///
/// @throws std::invalid_argument if the logs disagree in rate, period or channels, a realization
/// asked
///         for is not there, or nothing complete is; FormatError if a run is not a whole number of
///         periods or has none after the transient.
ChosenRuns choose_runs(const std::vector<const LogReader*>& logs, const FrfOptions& options);

}  // namespace stageid
