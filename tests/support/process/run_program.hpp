#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stageid::test {

struct ProgramResult {
  int exit_code = -1;  ///< 128 + n if signal n ended it
  std::string out;
  std::string err;
};

struct ProgramOptions {
  std::filesystem::path working_directory;  ///< empty: as it is
  long long largest_file_bytes = -1;        ///< >= 0: writes beyond fail, as on a full disk
  double interrupt_after_s = -1.0;          ///< >= 0: sends SIGINT once so long after the start
  /// Count interrupt_after_s from when this file is there, so that a busy machine changes nothing.
  std::filesystem::path interrupt_after_file;
};

/// Runs a program to its end, stdin empty, stdout and stderr caught. No shell in between.
ProgramResult run_program(const std::filesystem::path& program,
                          const std::vector<std::string>& arguments,
                          const ProgramOptions& options = {});

}  // namespace stageid::test
