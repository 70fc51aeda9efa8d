#pragma once

#include <memory>

#include "hal/can/can_stage.hpp"
#include "hal/stage/resident_stage.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid {

/// The stage at the SocketCAN interfaces of its file, with a node that answers.
/// @throws std::invalid_argument if a bus cannot carry it; @throws StageError if there is no interface, no node, or
/// another node than described in the file.
std::unique_ptr<CyclicStage> make_can_stage(const StageConfig& config,
                                            const CanHostOptions& options);
std::unique_ptr<ResidentStage> make_can_resident_stage(const StageConfig& config,
                                                       const CanHostOptions& options);

}  // namespace stageid
