#pragma once

#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_steps.hpp"

namespace stageid {

/// Spectra of one run by the local polynomial method: stretches of clean periods, as long as there
/// are up to 16, are transformed as a whole and their transient modelled (TransientModel) instead of
/// waited for. A stretch must not have a gap, so a marked period ends one; the means are weighted by
/// the stretches' periods. A single period between marked ones is used only if there is nothing else. With
/// PeriodChoice::consistent a period with a glitch (find_glitches()) counts as marked.
/// Memory: samples and spectra of 16 periods of the chosen channels, however long the run.
/// `health`, if there is one, gets each period as well.
/// @throws FormatError if no clean period is left; std::invalid_argument as TransientModel; what
///         LogReader::read() throws.
RunSpectra measure_record(const UsedRun& run, const RunExcitation& excitation,
                          const ChannelChoice& channels, PeriodChoice choice,
                          RunWorkspace& workspace, HealthPart* health,
                          const std::function<void(double bytes)>& read_done);

}  // namespace stageid
