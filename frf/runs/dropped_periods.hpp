#pragma once

#include <string>
#include <vector>

#include "frf/periods/period_outliers.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/runs/channel_choice.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Compares the periods of a group of one run in RunWorkspace::record and spectra. A short glitch is replaced
/// (bridge_samples()), another difference costs the period.
class DroppedPeriods {
 public:
  DroppedPeriods(const UsedRun& used, const SpectrumLines& lines, const ChannelChoice& channels,
                 RunWorkspace& workspace)
      : used_(used), lines_(lines), channels_(channels), w_(workspace) {}

  /// Stores the samples of the period in the workspace as number `place` of the group, minus those of the first one,
  /// which has the same excitation: the difference is noise, for which a float is accurate enough.
  void keep_samples(std::size_t place);

  /// Notes in `run` what is dropped or replaced. @param numbers  of the group's periods in the run, ascending
  /// @returns for each of them whether it is used
  std::vector<char> settle(const std::vector<int>& numbers, RunSpectra& run);

 private:
  bool replace(const PeriodOutlier& outlier, const std::vector<std::size_t>& reference,
               IndexRange& replaced);
  void bridge(std::size_t place, const std::vector<std::size_t>& reference, IndexRange range);
  std::string reason(const PeriodOutlier& outlier) const;

  const UsedRun& used_;
  const SpectrumLines& lines_;
  const ChannelChoice& channels_;
  RunWorkspace& w_;
};

}  // namespace stageid
