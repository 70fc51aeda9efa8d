#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/key_suggestion.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/manual/command_tree.hpp"

namespace stageid {
namespace {

/// stageid help [COMMAND ...]: what `stageid COMMAND ... --help` prints.
/// @throws std::invalid_argument for an unknown command, naming the nearest one
void print_help(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* command = &app;
  std::string path;
  for (const std::string& word : words) {
    const std::vector<std::string> names = names_of(command_tree(*command).commands);
    if (std::ranges::find(names, word) == names.end())
      fail_request(
          "help: unknown command '{}'{}; {}", word, path.empty() ? "" : " of" + path,
          names.empty() ? fmt::format("write 'stageid help{}'", path) : suggest_key(word, names));
    command = command->get_subcommand(word);
    path += " " + word;
  }
  // Not help(): that of the program would print the help of the called command, which is this one.
  fmt::print("{}", command->get_formatter()->make_help(command, app.get_name() + path,
                                                       CLI::AppFormatMode::Normal));
}

}  // namespace

void help_command(CLI::App& app, Console&) {
  const auto words = std::make_shared<std::vector<std::string>>();
  // Of all other commands, which were added before.
  const std::vector<std::string> names = names_of(command_tree(app).commands);
  CLI::App& command = add_command(app, "help", "Describe a command and its options");
  command
      .add_option("command", *words,
                  "name of the command, e.g. 'frf' or 'log info'; default: list all")
      ->type_name(fmt::format("TEXT:{{{}}}", fmt::join(names, ",")));
  command.final_callback([words, &app] { print_help(app, *words); });
}

}  // namespace stageid
