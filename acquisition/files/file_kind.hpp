#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace stageid {

class Hdf5File;

/// By the first bytes; false also if the file cannot be read.
bool is_hdf5(const std::filesystem::path& file);
/// Whether these are the first bytes of an HDF5 file; at least 8.
bool is_hdf5_head(std::string_view head) noexcept;

/// Describes the kind of a file by its content, and the commands that accept it:
/// "is a native log, not a model; use it with 'stageid frf', 'validate', 'report' or 'log'".
///
/// @param wanted expected kind, "a model"
/// @returns empty if the file cannot be read or its kind is unknown
std::string other_kind(const std::filesystem::path& file, const std::string& wanted);

/// The same for an HDF5 file with this attribute `format`; empty if it is unknown.
std::string other_hdf5_kind(const std::string& format, const std::string& wanted);

/// @param wanted  as above @param hint  ends the message if the kind is unknown
/// @throws FormatError unless the attribute `format` of the file is this one
void require_format(const Hdf5File& file, const std::string& format, const std::string& wanted,
                    const std::string& hint = "");
/// @throws FormatError unless the attribute `format_version` is this one
void require_version(const Hdf5File& file, long long version);

}  // namespace stageid
