#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid manual -o DIR
class ManualCommand {
 public:
  /// The commands of `app` are read when this command runs, because all of them exist by then.
  ManualCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  const CLI::App& app_;
  Console& console_;
  std::filesystem::path output_;
};

}  // namespace stageid
