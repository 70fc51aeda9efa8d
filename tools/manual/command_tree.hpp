#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace stageid {

/// A flag or an argument of a command.
struct CommandOption {
  std::vector<std::string> flags;  ///< "-o", "--output"; empty: an argument
  std::string name;                ///< of an argument
  std::string value;               ///< "FILE", "HZ HZ"; empty: takes none
  std::vector<std::string> words;  ///< possible values that are words
  std::string default_value;       ///< empty: none is documented
  std::string help;
  bool required = false;
  bool repeats = false;
};

/// All commands and options, for manual and completion, read from the parser itself.
struct CommandTree {
  std::string name;
  std::string help;
  std::string footer;
  std::vector<CommandOption> options;
  std::vector<CommandOption> arguments;
  std::vector<CommandTree> commands;
};

CommandOption command_option(const CLI::Option& option);
CommandTree command_tree(const CLI::App& app);

/// All flags of the options, "-o", "--output", ...
std::vector<std::string> flags_of(const std::vector<CommandOption>& options);
std::vector<std::string> names_of(const std::vector<CommandTree>& commands);

}  // namespace stageid
