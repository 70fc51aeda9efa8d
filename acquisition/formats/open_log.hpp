#pragma once

#include <filesystem>
#include <memory>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Opens a native log or an HDF5 one, told apart by their first bytes.
///
/// A native log that was cut short or is damaged is a FormatError that names the remedy
/// ("stageid log recover"), unless `damaged_is_error` is false: then what is intact is given.
/// @throws FileError, FormatError
std::unique_ptr<LogReader> open_log(const std::filesystem::path& file,
                                    bool damaged_is_error = true);

}  // namespace stageid
