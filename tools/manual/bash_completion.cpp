#include "tools/manual/bash_completion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace stageid {
namespace {

/// The parts of the script that depend on the commands.
struct Cases {
  std::string paths;  ///< words after which the next word is a command
  std::string words;  ///< possible words, by command
  std::string values;
};

/// @param path quoted, as a pattern for `case`
void add_values(const std::string& path, const CommandTree& command, Cases& cases) {
  for (const CommandOption& option : command.options) {
    if (option.words.empty()) continue;
    for (const std::string& flag : option.flags)
      cases.values += fmt::format("    {}' {}') words='{}' flags='' ;;\n", path, flag,
                                  fmt::join(option.words, " "));
  }
}

void add_command(const std::string& path, const CommandTree& command, const CommandTree& program,
                 Cases& cases) {
  std::vector<std::string> flags;
  for (const CommandOption& option : options_taken(command, program))
    flags.insert(flags.end(), option.flags.begin(), option.flags.end());
  std::vector<std::string> words = names_of(command.commands);
  for (const CommandOption& argument : command.arguments)
    words.insert(words.end(), argument.words.begin(), argument.words.end());
  if (!path.empty()) add_values(fmt::format("'{}'", path), command, cases);
  cases.words += fmt::format("    '{}') words='{}' flags='{}' ;;\n", path, fmt::join(words, " "),
                             fmt::join(flags, " "));
  for (const CommandTree& sub : command.commands)
    cases.paths +=
        fmt::format("      '{} {}') path='{}' ;;\n", path, sub.name, path_below(path, sub));
}

}  // namespace

std::string bash_completion(const CommandTree& program) {
  Cases cases;
  for_each_command(program, [&](const std::string& path, const CommandTree& command) {
    add_command(path, command, program, cases);
  });
  add_values("*", program, cases);
  return fmt::format(R"(# Completion of {0} for bash, written by '{0} manual'.
_{0}() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} path='' words='' flags='' i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$path ${{COMP_WORDS[i]}}" in
{1}    esac
  done
  case "$path" in
{2}  esac
  case "$path $prev" in
{3}  esac
  [[ $cur == -* ]] && words=$flags
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
}}
complete -o default -F _{0} {0}
)",
                     program.name, cases.paths, cases.words, cases.values);
}

}  // namespace stageid
