#pragma once

#include <string>

#include "tools/fleet/fleet_config.hpp"

namespace stageid {

/// Submits an array of tasks to Slurm, each of which runs this fleet: they share its jobs, see run_fleet(). sbatch takes
/// its own options, such as partition and time limit, from the environment (SBATCH_PARTITION, ...).
/// @param workers jobs at a time per task; 0: one per processor of the task
/// @returns the number of the Slurm job   @throws FileError with the message of sbatch
std::string submit_fleet(const FleetConfig& config, int tasks, int workers);

}  // namespace stageid
