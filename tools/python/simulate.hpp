#pragma once

#include <filesystem>
#include <memory>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Performs an experiment file on its simulated stage in virtual time, interruptibly: the same samples as
/// `stageid run CONFIG --backend sim --pace 0`, in arrays over the recorded rows.
/// @throws FileError, FormatError, std::invalid_argument; Interrupted
/// @throws StageError naming the limit or fault that ended the experiment
std::shared_ptr<LogReader> simulate(const std::filesystem::path& config);

}  // namespace stageid
