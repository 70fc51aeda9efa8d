#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

namespace stageid {

/// A flag or an argument of a command.
struct CommandOption {
  std::vector<std::string> flags;  ///< "-o", "--output"; empty: an argument
  std::string name;                ///< of an argument
  std::string value;               ///< "TEXT"; empty: takes none
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

CommandTree command_tree(const CLI::App& app);

/// The options accepted after a command: its own, and the program's --json and --verbosity, which are accepted before
/// and after it.
std::vector<CommandOption> options_taken(const CommandTree& command, const CommandTree& program);

/// The words that lead to a command of the command at `path`.
std::string path_below(const std::string& path, const CommandTree& sub);

/// Visits the program, then its commands, each before its own.
/// @param visit takes the words that lead to the command ("", "log", "log info") and the command
void for_each_command(const CommandTree& program,
                      const std::function<void(const std::string&, const CommandTree&)>& visit);

/// All flags of the options, "-o", "--output", ...
std::vector<std::string> flags_of(const std::vector<CommandOption>& options);
std::vector<std::string> names_of(const std::vector<CommandTree>& commands);

}  // namespace stageid
