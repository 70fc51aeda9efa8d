#pragma once

#include <filesystem>
#include <string>

namespace stageid {

/// From now on, no file is both read and replaced: note_input() and OutputFile refuse the second use. For the program;
/// a user of the libraries may replace what was read.
void protect_inputs();

/// Call before reading a file of the user. @throws std::invalid_argument if it is to be replaced.
void note_input(const std::filesystem::path& file);

/// Call before replacing a file. @throws std::invalid_argument if it was read.
void note_output(const std::filesystem::path& file);

/// A file that this command may read and replace: its own temporary files and results.
/// @throws std::invalid_argument if it was read before
void note_own_file(const std::filesystem::path& file);

/// The content of an input. @throws FileError if it cannot be read to its end, or is a device or directory
std::string read_whole_file(const std::filesystem::path& file);

}  // namespace stageid
