#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Reads a log and examines it. Controller and rigid body are those of `stage_file`, or of the stage file in the log.
/// Shows progress.
/// @throws as read_health_record() and nominal_stage_of(); Interrupted
std::vector<Finding> examine_log(const LogReader& log, const std::filesystem::path& stage_file,
                                 const Console& console);

/// Findings from the record of the logs and the response estimated from them.
std::vector<Finding> examine(const FrfEstimate& frf, HealthRecord record,
                             const std::optional<NominalStage>& nominal);

/// The table with one line per finding; a single line if there are none.
std::vector<std::string> health_lines(const std::vector<Finding>& findings);
Json health_json(const std::vector<Finding>& findings);

/// Faults and doubts as sentences, for notes; or only those of one severity.
std::vector<std::string> health_notes(const std::vector<Finding>& findings,
                                      std::optional<Severity> only = {});

/// Adds findings from the response itself (check_interpolation(), check_settling()) to those of its logs, and stores
/// all of them as "health" in its provenance; returns them, faults first.
std::vector<Finding> keep_health(FrfEstimate& frf, std::vector<Finding> findings);
/// The findings stored by keep_health(); empty if there are none in our format.
std::vector<Finding> health_of(const std::string& provenance_json);

}  // namespace stageid
