#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/run_program.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test {

std::string replaced(std::string text, const std::string& from, const std::string& to);

/// Says where two contents part, without printing them: most are binary or long.
testing::AssertionResult same_bytes(const std::string& a, const std::string& b);

/// Names and contents of everything below a directory: to show that nothing was left or changed.
std::map<std::string, std::string> snapshot(const std::filesystem::path& directory);

/// A directory with copies of the small configurations, and the real program.
struct ProgramTest : testing::Test {
  ProgramTest();

  std::filesystem::path at(const std::string& name) const { return directory_ / name; }
  std::string name(const std::string& file) const { return at(file).string(); }
  /// In the directory, so that names of files in it need no path. The line is divided at spaces.
  ProgramResult run(const std::string& line, ProgramOptions options = {}) const;
  /// Runs and expects exit code 0.
  ProgramResult succeed(const std::string& line) const;
  /// Runs and expects `exit_code`, and `text` on stderr.
  ProgramResult ends(const std::string& line, int exit_code, const std::string& text = "",
                     ProgramOptions options = {}) const;
  /// The object that a command prints with --json.
  nlohmann::json tell(const std::string& line, int exit_code = 0) const;
  /// Expects `exit_code`, one line on stderr "stageid: ..." that contains `text`, nothing on stdout,
  /// and that no file appeared or changed.
  void fail(const std::string& line, int exit_code, const std::string& text,
            ProgramOptions options = {}) const;

  /// Writes a variant of the small experiment (or stage) and returns its name.
  std::string experiment(const std::string& file, const std::string& from,
                         const std::string& to) const;
  std::string stage(const std::string& file, const std::string& from, const std::string& to) const;

  /// run.slog of the small experiment; made once per test.
  void make_log() const;
  void make_frf() const;
  /// model.json on the band of the configuration; makes frf.h5 too.
  void make_model() const;

  TemporaryDirectory directory_;
  std::string config_;
};

}  // namespace stageid::test
