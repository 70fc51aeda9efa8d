#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace stageid {

/// Runs `work` on a copy of this process and returns its text. For libraries that crash or never end on a damaged
/// `file`: the copy may use kChildSeconds of processor time and one more for every kBytesPerSecond of the file, and
/// kChildBytes of memory and kChildBytesPerByte for every byte of the file on top of what the process has.
/// @throws FormatError, FileError as `work` does; FormatError if the copy crashes or exceeds a limit.
std::string in_child(const std::filesystem::path& file, const std::function<std::string()>& work);

inline constexpr std::size_t kChildBytes = std::size_t{1} << 30;
inline constexpr std::size_t kChildBytesPerByte = 64;
inline constexpr std::size_t kChildSeconds = 5;
inline constexpr std::size_t kBytesPerSecond = std::size_t{1} << 25;

}  // namespace stageid
