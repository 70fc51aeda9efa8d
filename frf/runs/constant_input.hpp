#pragma once

#include "frf/runs/channel_choice.hpp"
#include "frf/runs/realization_spectra.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// An input that shows one value throughout a realization makes U singular on every line; said by its
/// name rather than by a line.
/// @throws std::invalid_argument naming the first such channel
void refuse_constant_inputs(const RealizationRuns& realization, const RealizationSpectra& spectra,
                            const ChannelChoice& channels);

}  // namespace stageid
