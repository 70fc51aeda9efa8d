#pragma once

#include "acquisition/record/run_timing.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// For pages and --json: quantiles in seconds and the bins [[from_s, to_s, count], ...] of both histograms, and
/// skipped cycles; null without timing (virtual time).
SortedJson timing_json(const RunTiming& timing);

}  // namespace stageid
