#pragma once

#include "estimation/search/search_state.hpp"

namespace stageid {

/// Adds modes while they are worth their parameters. @returns true if any was added.
bool grow(SearchState& state);

/// Drops modes that are not worth their parameters, and merges those that describe one resonance.
void reduce(SearchState& state);

}  // namespace stageid
