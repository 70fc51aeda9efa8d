#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace stageid {

/// stageid help [COMMAND ...]: what `stageid COMMAND ... --help` prints.
class HelpCommand {
 public:
  /// The last command to be made: it completes the names of the others.
  explicit HelpCommand(CLI::App& app);

 private:
  /// @throws std::invalid_argument for a word that is no command; the nearest one is named
  void run() const;

  const CLI::App& app_;
  std::vector<std::string> words_;
};

}  // namespace stageid
