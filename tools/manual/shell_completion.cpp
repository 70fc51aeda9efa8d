#include "tools/manual/shell_completion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <vector>

#include "tools/terminal/shell_word.hpp"

namespace stageid {
namespace {

/// name:description for _describe of zsh, shortened to the first clause.
std::string described(const std::string& name, const std::string& help) {
  std::string entry;
  for (const char c : name) entry += c == ':' ? std::string("\\:") : std::string(1, c);
  return shell_word(entry + ":" + help.substr(0, help.find(';')));
}

/// The options accepted after a command: its own, and the program's --json and --verbosity, which are accepted before
/// and after it.
std::vector<CommandOption> options_taken(const CommandTree& command, const CommandTree& program) {
  std::vector<CommandOption> options = command.options;
  if (&command == &program) return options;
  std::ranges::copy_if(program.options, std::back_inserter(options), [](const auto& option) {
    return option.flags.back() != "--help" && option.flags.back() != "--version";
  });
  return options;
}

/// The parts of a script that depend on the commands.
struct Cases {
  std::string paths;   ///< words after which the next word is a command
  std::string words;   ///< possible words, by command
  std::string values;  ///< possible words, by command and flag
};

/// @param path_variable holds the words that lead to a command
/// @param assign_words assigns the possible words of a command; assign_values: those of a flag, with {} for them
Cases cases_of(const CommandTree& program, const char* path_variable,
               const std::function<std::string(const CommandTree&)>& assign_words,
               const char* assign_values) {
  Cases cases;
  const auto add_values = [&](const std::string& path, const CommandTree& command) {
    for (const CommandOption& option : command.options)
      for (const std::string& flag : option.flags)
        if (!option.words.empty())
          cases.values +=
              fmt::format("    {}{}) {} ;;\n", path, shell_word(" " + flag),
                          fmt::format(fmt::runtime(assign_values), fmt::join(option.words, " ")));
  };
  // `path`: the words that lead to the command: "", "log", "log info".
  const auto visit = [&](const auto& self, const std::string& path,
                         const CommandTree& command) -> void {
    cases.words += fmt::format("    {}) {} ;;\n", shell_word(path), assign_words(command));
    if (!path.empty()) add_values(shell_word(path), command);
    const std::string prefix = path.empty() ? "" : path + " ";
    for (const CommandTree& sub : command.commands)
      cases.paths += fmt::format("      {}) {}={} ;;\n", shell_word(path + " " + sub.name),
                                 path_variable, shell_word(prefix + sub.name));
    for (const CommandTree& sub : command.commands) self(self, prefix + sub.name, sub);
  };
  visit(visit, "", program);
  add_values("*", program);
  return cases;
}

}  // namespace

std::string bash_completion(const CommandTree& program) {
  const auto assign_words = [&](const CommandTree& command) {
    const std::vector<std::string> flags = flags_of(options_taken(command, program));
    std::vector<std::string> words = names_of(command.commands);
    for (const CommandOption& argument : command.arguments)
      words.insert(words.end(), argument.words.begin(), argument.words.end());
    return fmt::format("words='{}' flags='{}'", fmt::join(words, " "), fmt::join(flags, " "));
  };
  const Cases cases = cases_of(program, "path", assign_words, "words='{}' flags=''");
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

std::string zsh_completion(const CommandTree& program) {
  const auto assign_words = [&](const CommandTree& command) {
    std::vector<std::string> flags;
    for (const CommandOption& option : options_taken(command, program))
      for (const std::string& flag : option.flags) flags.push_back(described(flag, option.help));
    std::vector<std::string> next;
    for (const CommandTree& sub : command.commands) next.push_back(described(sub.name, sub.help));
    for (const CommandOption& argument : command.arguments)
      for (const std::string& word : argument.words) next.push_back(shell_word(word));
    return fmt::format("next=({})\n      flags=({})", fmt::join(next, " "), fmt::join(flags, " "));
  };
  const Cases cases = cases_of(program, "place", assign_words, "values=({})");
  return fmt::format(R"(#compdef {0}
# Completion of {0} for zsh, written by '{0} manual'.
_{0}() {{
  local place='' i
  local -a next flags values
  for ((i = 2; i < CURRENT; i++)); do
    case "$place ${{words[i]}}" in
{1}    esac
  done
  case "$place" in
{2}  esac
  case "$place ${{words[CURRENT-1]}}" in
{3}  esac
  if [[ ${{words[CURRENT]}} == -* ]]; then
    _describe -o flag flags
  elif (( ${{#values}} )); then
    compadd -a values
  elif (( ${{#next}} )); then
    _describe command next || _files
  else
    _files
  fi
}}
_{0} "$@"
)",
                     program.name, cases.paths, cases.words, cases.values);
}

}  // namespace stageid
