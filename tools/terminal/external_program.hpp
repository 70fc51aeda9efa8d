#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

struct ExternalEnd {
  int status = 0;        ///< as of waitpid()
  std::string messages;  ///< stdout and stderr
};

/// Runs a program of another package, found in PATH, without input. The language of its messages is that of the locale C.
/// @param words may begin with variables of its environment, NAME=VALUE
/// @param directory where it runs; empty: here
/// @param package   Debian package that contains it
/// @throws FileError if it is not installed or cannot be started
ExternalEnd run_external(const std::vector<std::string>& words,
                         const std::filesystem::path& directory, const std::string& package);

/// Kills the program that is running, from any thread.
void kill_external() noexcept;

}  // namespace stageid
