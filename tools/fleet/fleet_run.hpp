#pragma once

#include <cstddef>
#include <vector>

#include "tools/fleet/fleet_config.hpp"
#include "tools/fleet/fleet_jobs.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// Numbers of jobs.
struct FleetSummary {
  std::size_t jobs = 0;
  std::size_t done_before = 0;
  std::size_t done = 0;             ///< by this call
  std::size_t not_trustworthy = 0;  ///< of these
  std::size_t failed = 0;           ///< also in other processes meanwhile
};

/// Identifies every log of a fleet that is not in its store, each in a process of its own, so that a damaged log ends one job
/// only. A failed job is stored with its error and runs again next time. Several processes may run the same fleet:
/// each job is claimed by a lock that ends with its process, and each process ends when all jobs have ended.
/// @param workers processes at a time; 0: one per core
/// @throws FileError, FormatError, std::invalid_argument: nothing more can be stored, or nothing can be read
FleetSummary run_fleet(const FleetConfig& config, const std::vector<FleetLog>& logs, int workers,
                       const Console& console);

/// How many jobs run_fleet() would run.
std::size_t open_jobs(const FleetConfig& config, const std::vector<FleetLog>& logs,
                      const Console& console);

}  // namespace stageid
