#pragma once

#include <filesystem>
#include <optional>

#include "acquisition/record/log_info.hpp"
#include "frf/wiring/nominal_stage.hpp"
#include "hal/simulator/simulated_stage.hpp"

namespace stageid {

/// What a stage file says of controller and rigid body, for the checks of a log's health.
NominalStage nominal_stage(const WaferStageSpec& spec);

/// That of `stage_file`, or of a controller file (controller_file.hpp); if it is empty, of the stage file that a log of ours carries in its metadata.
/// Nothing if the log carries none, or one that this version cannot read.
/// @throws FileError, FormatError of `stage_file`
std::optional<NominalStage> nominal_stage_of(const LogInfo& info,
                                             const std::filesystem::path& stage_file);

}  // namespace stageid
