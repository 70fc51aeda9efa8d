#pragma once

#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_steps.hpp"

namespace stageid {

/// Spectra of one run by the local polynomial method. Stretches of up to 16 clean periods are transformed as a whole,
/// and their transient is modelled (TransientModel) instead of discarded. A stretch must not have a gap, so a marked
/// period ends it. The means are weighted by the number of periods. A single period between marked ones is used
/// only if there is nothing else. With PeriodChoice::consistent, a period with a glitch (find_glitches()) counts as
/// marked.
/// Memory: samples and spectra of 16 periods of the selected channels, for any length of the run.
/// `health`, if not null, receives each period as well.
/// @throws FormatError if no clean period is left; std::invalid_argument as TransientModel; the same as
/// LogReader::read().
RunSpectra measure_record(const UsedRun& run, const RunExcitation& excitation,
                          const ChannelChoice& channels, PeriodChoice choice,
                          RunWorkspace& workspace, HealthPart* health, const ReadDone& read_done);

}  // namespace stageid
