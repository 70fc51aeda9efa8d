#include "tools/manual/shell_completion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <vector>

#include "tools/terminal/shell_word.hpp"
#include "tools/terminal/text_template.hpp"

namespace stageid {

// From the files of these names.
extern const std::string_view completion_bash;
extern const std::string_view completion_zsh;

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

std::string script(std::string_view text, const CommandTree& program, const Cases& cases) {
  return fill_template(text, {{"program", program.name},
                              {"paths", cases.paths},
                              {"words", cases.words},
                              {"values", cases.values}});
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
  return script(completion_bash, program, cases);
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
  return script(completion_zsh, program, cases);
}

}  // namespace stageid
