#pragma once

#include <functional>
#include <string>
#include <vector>

#include "frf/periods/sample_slip.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Receives a period that is not used, and the reason.
using LeaveOut = std::function<void(int period, const std::string& why)>;

/// Reads the measured periods of a run in order into the workspace's samples. It calls take(p) for clean ones and
/// leave_out(p, why) for those with a marked sample or a gap. After a gap, the periods are read displaced by the lost
/// samples, so that all have the phase of the first. If rows are missing for this at the end of the run, the last
/// period is rotated. With an earlier estimate, its dropped periods are left
/// out and its steps applied to the samples of clean ones; gaps are found in the records as they are.
/// @returns the positions of lost samples
/// @throws the same as LogReader::read()
std::vector<SampleSlip> for_each_period(const UsedRun& used, RunWorkspace& w,
                                        const ReadDone& read_done,
                                        const std::function<void(int period)>& take,
                                        const LeaveOut& leave_out);

}  // namespace stageid
