#pragma once

#include <filesystem>
#include <string>

namespace stageid {

/// What a file is instead of what was wanted, told by its content, and which commands take it:
/// "is a native log, not a model; 'stageid frf', 'validate', 'report' and 'log' take it".
///
/// @param wanted "a model"
/// @returns empty if the file cannot be read or is of no kind known here
std::string other_kind(const std::filesystem::path& file, const std::string& wanted);

/// The same of an HDF5 file by its attribute `format`; empty if that is none of ours.
std::string other_hdf5_kind(const std::string& format, const std::string& wanted);

}  // namespace stageid
