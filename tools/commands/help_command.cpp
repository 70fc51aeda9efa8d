#include "tools/commands/help_command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

#include "acquisition/files/key_suggestion.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/manual/command_tree.hpp"

namespace stageid {

HelpCommand::HelpCommand(CLI::App& app) : app_(app) {
  const std::vector<std::string> names = names_of(command_tree(app).commands);
  CLI::App* command = add_command(app, "help", "Describe a command and its options");
  command
      ->add_option("command", words_, "name of the command: 'frf', 'log info'; default: list all")
      ->type_name(fmt::format("TEXT:{{{}}}", fmt::join(names, ",")));
  command->final_callback([this] { run(); });
}

void HelpCommand::run() const {
  const CLI::App* command = &app_;
  std::string path;
  for (const std::string& word : words_) {
    const std::vector<std::string> names = names_of(command_tree(*command).commands);
    if (std::find(names.begin(), names.end(), word) == names.end())
      throw std::invalid_argument(fmt::format(
          "help: unknown command '{}'{}; {}", word, path.empty() ? "" : " of" + path,
          names.empty() ? fmt::format("write 'stageid help{}'", path) : suggest_key(word, names)));
    command = command->get_subcommand(word);
    path += " " + word;
  }
  // Not help(): that of the program would print the help of the called command, which is this one.
  fmt::print("{}", command->get_formatter()->make_help(command, app_.get_name() + path,
                                                       CLI::AppFormatMode::Normal));
}

}  // namespace stageid
