#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

/// Requires that a result does not replace one of its inputs, under any name or link.
/// @throws std::invalid_argument naming the file
void require_no_input(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs);

/// Requires, before long work, that a file can be written and is not one of the inputs. Leaves nothing behind.
/// @throws FileError naming the file and the reason; std::invalid_argument
void require_writable(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs);

/// "FILE: MESSAGE", without a duplicate if the message already begins with the file
std::string named(const std::filesystem::path& file, const std::string& message);

/// @throws FileError with the reason if the file cannot be read, including directories
void require_readable(const std::filesystem::path& file);

/// Requires a valid extension for this kind of file, because readers depend on it.
/// @throws std::invalid_argument "FILE: WHAT is written as ENDING, ..."
void require_ending(const std::filesystem::path& file, const std::string& what,
                    const std::vector<std::string>& endings);

/// require_ending() for the outputs of `fit` and of `frf`.
void require_model_ending(const std::filesystem::path& file);
void require_frf_ending(const std::filesystem::path& file);

/// Creates the directory if it does not exist. @throws FileError
void require_directory(const std::filesystem::path& directory,
                       const std::string& remedy = "choose another with -o");

}  // namespace stageid
