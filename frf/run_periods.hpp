#pragma once

#include <cstdint>
#include <functional>

#include "frf/run_spectra.hpp"
#include "frf/run_table.hpp"

namespace stageid {

/// Reads the measured periods of a run one after the other into the workspace's samples: take(p) for a
/// clean one, leave_out(p) for one with a marked sample. `read_done` is told the bytes of each.
/// @throws what LogReader::read() throws
template <typename Take, typename LeaveOut>
void for_each_period(const UsedRun& used, RunWorkspace& w,
                     const std::function<void(double bytes)>& read_done, Take&& take,
                     LeaveOut&& leave_out) {
  const auto period = static_cast<std::uint64_t>(w.dft.length());
  for (int p = 0; p < used.periods; ++p) {
    const auto first = static_cast<std::uint64_t>(used.transient_periods + p) * period;
    used.log->read(used.index, first, period, w.samples);
    read_done(static_cast<double>(w.samples.actuators.size() + w.samples.sensors.size()) *
              sizeof(double));
    if ((w.samples.marked != 0).any())
      leave_out(p);
    else
      take(p);
  }
}

}  // namespace stageid
