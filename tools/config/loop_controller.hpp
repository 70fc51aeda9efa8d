#pragma once

#include <filesystem>
#include <string>

#include "hal/stage/stage.hpp"
#include "tools/config/controller_keys.hpp"

namespace stageid {

/// A controller in a file, as text of format "stageid-controller": the file itself (.yaml, .json), or its arrays A, B, C
/// and D (.mat, .npz, .h5) or [A B; C D] (.csv) with the channels of the stage in their order.
/// @throws FileError, FormatError
std::string loop_controller_text(const std::filesystem::path& file, const StageInfo& stage);

/// The controller of such a text. `name` is used in errors only.
/// @throws FormatError unless it can be computed sample by sample: discrete at the sample rate of the stage
LinearControllerKeys parse_loop_controller(const std::filesystem::path& name, std::string text,
                                           double sample_rate_hz);

}  // namespace stageid
