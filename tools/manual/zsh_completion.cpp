#include "tools/manual/zsh_completion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

namespace stageid {
namespace {

/// In single quotes.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// name:description for _describe, shortened to the first clause.
std::string described(const std::string& name, const std::string& help) {
  std::string entry;
  for (const char c : name) entry += c == ':' ? std::string("\\:") : std::string(1, c);
  return quoted(entry + ":" + help.substr(0, help.find(';')));
}

/// The parts of the script that depend on the commands.
struct ZshParts {
  std::string paths;   ///< words after which the next word is a command
  std::string offers;  ///< possible words, by command
  std::string values;
};

void add_zsh_values(const std::string& path, const CommandTree& command, ZshParts& cases) {
  for (const CommandOption& option : command.options) {
    if (option.words.empty()) continue;
    for (const std::string& flag : option.flags)
      cases.values += fmt::format("    {}{}) values=({}) ;;\n", path, quoted(" " + flag),
                                  fmt::join(option.words, " "));
  }
}

void add_zsh_command(const std::string& path, const CommandTree& command,
                     const CommandTree& program, ZshParts& cases) {
  std::vector<std::string> flags;
  for (const CommandOption& option : options_taken(command, program))
    for (const std::string& flag : option.flags) flags.push_back(described(flag, option.help));
  std::vector<std::string> next;
  for (const CommandTree& sub : command.commands) next.push_back(described(sub.name, sub.help));
  for (const CommandOption& argument : command.arguments)
    for (const std::string& word : argument.words) next.push_back(quoted(word));
  cases.offers += fmt::format("    {}) next=({})\n      flags=({}) ;;\n", quoted(path),
                              fmt::join(next, " "), fmt::join(flags, " "));
  if (!path.empty()) add_zsh_values(quoted(path), command, cases);
  for (const CommandTree& sub : command.commands)
    cases.paths += fmt::format("      {}) place={} ;;\n", quoted(path + " " + sub.name),
                               quoted(path_below(path, sub)));
}

}  // namespace

std::string zsh_completion(const CommandTree& program) {
  ZshParts cases;
  for_each_command(program, [&](const std::string& path, const CommandTree& command) {
    add_zsh_command(path, command, program, cases);
  });
  add_zsh_values("*", program, cases);
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
                     program.name, cases.paths, cases.offers, cases.values);
}

}  // namespace stageid
