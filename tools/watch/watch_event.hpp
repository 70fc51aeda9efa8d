#pragma once

#include <string>
#include <vector>

#include "estimation/tracking/model_tracker.hpp"
#include "tools/terminal/json.hpp"
#include "tools/watch/watch_source.hpp"

namespace stageid {

/// As in docs/formats.md, with one sentence: what changed, how much, since when, how probable; and one with the remedy.
Json change_json(const StageChange& change, const ModelTracker& tracker, const AdditiveModel& model,
                 const WatchedPeriod& period, double period_s);

/// The tracked properties of a stage: name, change from the model, standard deviation.
Json tracked_json(const ModelTracker& tracker, const AdditiveModel& model);
std::vector<std::string> tracked_lines(const ModelTracker& tracker, const AdditiveModel& model);

}  // namespace stageid
