#pragma once

#include <string>
#include <utility>
#include <vector>

#include "frf/periods/actuator_step.hpp"
#include "frf/runs/channel_choice.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Inputs of an estimate: for each log the file's name and the fingerprint of the samples used (in the order of
/// realizations and experiments), the runs, the options, the version.
///
/// It excludes everything that may differ between two runs of the same estimate (directory, time, number of
/// threads), so that the output files are identical byte for byte.
class FrfProvenance {
 public:
  FrfProvenance(const LogInfo& info, const FrfOptions& options, const ChannelChoice& channels);
  void add(const UsedRun& run, const std::string& fingerprint);
  std::string json() const;

 private:
  struct Log {
    const LogReader* log = nullptr;
    std::vector<std::pair<int, int>> runs;  // realization, experiment
    std::string fingerprints;
  };
  const LogInfo& info_;
  const FrfOptions& options_;
  const ChannelChoice& channels_;
  std::vector<Log> logs_;
};

/// Adds "actuator_steps" to the provenance of an estimate from logs with these steps.
std::string with_steps(const std::string& provenance_json, const std::vector<ActuatorStep>& steps,
                       const ChannelList& actuators);

}  // namespace stageid
