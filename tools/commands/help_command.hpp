#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace stageid {

/// stageid help [COMMAND ...]: what `stageid COMMAND ... --help` prints.
class HelpCommand {
 public:
  /// Must be created after all other commands, because it completes their names.
  explicit HelpCommand(CLI::App& app);

 private:
  /// @throws std::invalid_argument for an unknown command, naming the nearest one
  void run() const;

  const CLI::App& app_;
  std::vector<std::string> words_;
};

}  // namespace stageid
