#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

/// That a result does not replace what it is made of, under whatever name or link.
/// @throws std::invalid_argument naming the file
void require_no_input(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs);

/// Before long work: that a file can be written there, and is none of the inputs. Nothing is left behind.
/// @throws FileError naming the file and the reason; std::invalid_argument
void require_writable(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs);

/// "FILE: MESSAGE"; errors of the file name it already
std::string named(const std::filesystem::path& file, const std::string& message);

/// @throws FileError why the file cannot be read, a directory included
void require_readable(const std::filesystem::path& file);

/// That the name ends as files of this kind do: readers go by the ending.
/// @throws std::invalid_argument "FILE: WHAT is written as ENDING, ..."
void require_ending(const std::filesystem::path& file, const char* what,
                    const std::vector<std::string>& endings);

/// require_ending() of what `fit` writes, and of what `frf` writes.
void require_model_ending(const std::filesystem::path& file);
void require_frf_ending(const std::filesystem::path& file);

/// Makes the directory if it is not there. @throws FileError
void require_directory(const std::filesystem::path& directory);

}  // namespace stageid
