#pragma once

#include <filesystem>
#include <optional>

#include "acquisition/record/log_info.hpp"
#include "frf/wiring/nominal_stage.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "hal/stage/stage_spec.hpp"

namespace stageid {

/// Controller and rigid body of a stage file, for the health checks of a log.
NominalStage nominal_stage(const StageSpec& stage, const std::optional<PlantSpec>& plant);

/// That of `stage_file`, or of a controller file (controller_file.hpp). If it is empty: that of the stage file in the
/// metadata of a stageid log; empty if the log has none, or one that this version cannot read.
/// @throws FileError, FormatError of `stage_file`
std::optional<NominalStage> nominal_stage_of(const LogInfo& info,
                                             const std::filesystem::path& stage_file);

}  // namespace stageid
