#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/formats/open_log.hpp"
#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/response/frf_options.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// Reads logs and examines them. Controller and rigid body are those of `stage_file`, or of the stage
/// file that the log carries. Shows progress.
/// @throws what open_log(), read_health_record() and nominal_stage_of() throw; Interrupted
std::vector<Finding> examine_logs(const std::vector<std::filesystem::path>& files,
                                  FrfOptions options, const std::filesystem::path& stage_file,
                                  const Console& console);

/// What the logs' record and the response estimated from them show.
std::vector<Finding> examine(const FrfEstimate& frf, HealthRecord record,
                             const std::optional<NominalStage>& nominal);

/// The table: one line a finding, in columns; a single line if there is none.
std::vector<std::string> health_lines(const std::vector<Finding>& findings);
nlohmann::ordered_json health_json(const std::vector<Finding>& findings);

/// Faults and doubts as sentences, for notes; or those of one severity.
std::vector<std::string> health_notes(const std::vector<Finding>& findings,
                                      std::optional<Severity> only = {});

/// Adds what the response itself shows (check_interpolation(), check_settling()) to the findings about its logs and keeps
/// all of them as "health" in its provenance; returns them, faults first.
std::vector<Finding> keep_health(FrfEstimate& frf, std::vector<Finding> findings);
/// What keep_health() kept. What is not there, or is not as written by us, is none.
std::vector<Finding> health_of(const std::string& provenance_json);

}  // namespace stageid
