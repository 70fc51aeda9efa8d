#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid manual -o DIR
class ManualCommand {
 public:
  /// `app` is asked for its commands when the command runs: all are there by then.
  ManualCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  const CLI::App& app_;
  Console& console_;
  std::filesystem::path output_;
};

}  // namespace stageid
