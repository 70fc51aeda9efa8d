#pragma once

#include <functional>
#include <string>
#include <vector>

#include "frf/periods/sample_slip.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Reads the measured periods of a run one after the other into the workspace's samples: take(p) for a
/// clean one, leave_out(p, why) for one with a marked sample or with a place where samples were lost or written
/// twice. Behind such a place the periods are read displaced by as much, so that all have the phase of the first;
/// where rows are missing for it at the end of the run the last period is turned in itself. `read_done` is told the
/// bytes of each.
/// @returns where samples are lost
/// @throws what LogReader::read() throws
std::vector<SampleSlip> for_each_period(
    const UsedRun& used, RunWorkspace& w, const std::function<void(double bytes)>& read_done,
    const std::function<void(int period)>& take,
    const std::function<void(int period, const std::string& why)>& leave_out);

}  // namespace stageid
