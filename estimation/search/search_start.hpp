#pragma once

#include "estimation/search/search_state.hpp"

namespace stageid {

/// The modes of the selection, or the peaks of the CMIF.
AdditiveModel start_model(SearchState& state);

/// The first fits of a search for a requested number of modes, which are placed at once by pole relocation.
void begin_placed(SearchState& state);

/// The first fit of an open search; then all modes are placed at once by pole relocation, if that is better.
void begin_open(SearchState& state, const AdditiveModel& model);

}  // namespace stageid
