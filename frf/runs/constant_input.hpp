#pragma once

#include "frf/runs/channel_choice.hpp"
#include "frf/runs/realization_spectra.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Refuses inputs that are constant throughout a realization. They make U singular on every line, and this error
/// names the channel instead of a line.
/// @throws std::invalid_argument naming the first such channel
void refuse_constant_inputs(const RealizationRuns& realization, const RealizationSpectra& spectra,
                            const ChannelChoice& channels);

}  // namespace stageid
