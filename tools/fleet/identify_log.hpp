#pragma once

#include "tools/fleet/fleet_config.hpp"
#include "tools/fleet/fleet_jobs.hpp"
#include "tools/fleet/fleet_store.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// Stage, time, tags, log and results of a job, also if its log cannot be read.
Identification described_job(const FleetConfig& config, const FleetLog& log,
                             const std::string& fingerprint);

/// One job of a fleet, with the steps of `identify` on a log: writes frf.h5, frf_validation.h5, model.json and
/// report.html into the folder of the job, which is emptied before.
/// @throws FileError, FormatError, std::invalid_argument, Interrupted
Identification identify_log(const FleetConfig& config, const FleetLog& log,
                            const std::string& fingerprint, const Console& console);

}  // namespace stageid
