#pragma once

#include <filesystem>
#include <memory>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Opens a native or an HDF5 log, depending on its first bytes.
///
/// A truncated or damaged native log is a FormatError that names the remedy ("stageid log recover"). If
/// `damaged_is_error` is false, the intact part is opened instead.
/// @throws FileError, FormatError
std::unique_ptr<LogReader> open_log(const std::filesystem::path& file,
                                    bool damaged_is_error = true);

}  // namespace stageid
