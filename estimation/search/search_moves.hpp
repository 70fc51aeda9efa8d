#pragma once

#include "estimation/search/search_state.hpp"

namespace stageid {

/// Changes the structure as long as that lowers the criterion, each time by the change that lowers it most.
/// @returns true if anything was changed
bool restructure(SearchState& state);

/// Replaces two modes closer than a half-power width by one if the second is not worth its parameters.
void merge(SearchState& state);

/// Returns to the model with which the search began if one delay, which is not to be estimated, is worth more than all
/// that was added since: modes and general damping imitate it.
bool a_delay_explains_more(SearchState& state);

}  // namespace stageid
