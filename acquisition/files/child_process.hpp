#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace stageid {

/// Runs `work` on a copy of this process and returns its text. For libraries that crash or never end on a damaged
/// `file`: the copy may use kChildSeconds of processor time per GiB of the file that was begun, and memory for
/// kChildBytes and kChildBytesPerByte of the file on top of what the process has.
/// @throws FormatError, FileError as `work` does; FormatError if the copy crashes or exceeds a limit.
std::string in_child(const std::filesystem::path& file, const std::function<std::string()>& work);

inline constexpr std::size_t kChildBytes = std::size_t{1} << 30;
inline constexpr std::size_t kChildBytesPerByte = 64;
inline constexpr std::size_t kChildSeconds = 30;

}  // namespace stageid
