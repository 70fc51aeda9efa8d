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
  std::vector<std::string> words;  ///< values it may have, as far as they are words
  std::string default_value;       ///< empty: none is told
  std::string help;
  bool required = false;
  bool repeats = false;
};

/// What a command line may hold, for manual and completion: all of it comes from the parser itself.
struct CommandTree {
  std::string name;
  std::string help;
  std::string footer;
  std::vector<CommandOption> options;
  std::vector<CommandOption> arguments;
  std::vector<CommandTree> commands;
};

CommandTree command_tree(const CLI::App& app);

/// The options that are taken behind a command: its own, and the program's, --json and --verbosity, which are taken
/// on either side of it.
std::vector<CommandOption> options_taken(const CommandTree& command, const CommandTree& program);

/// The words that lead to a command of the command at `path`.
std::string path_below(const std::string& path, const CommandTree& sub);

/// Visits the program, then its commands, each before its own.
/// @param visit takes the words that lead to the command ("", "log", "log info") and the command
void for_each_command(const CommandTree& program,
                      const std::function<void(const std::string&, const CommandTree&)>& visit);

/// Every flag of a command's options, "-o", "--output", ...
std::vector<std::string> flags_of(const CommandTree& command);
std::vector<std::string> names_of(const std::vector<CommandTree>& commands);

}  // namespace stageid
