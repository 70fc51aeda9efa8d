#pragma once

#include <filesystem>

namespace stageid {

/// Before long work: that a file can be written there. Nothing is left behind.
/// @throws FileError naming the file and the reason.
void require_writable(const std::filesystem::path& file);

/// Makes the directory if it is not there. @throws FileError
void require_directory(const std::filesystem::path& directory);

}  // namespace stageid
