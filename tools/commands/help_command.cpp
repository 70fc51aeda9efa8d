#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/key_suggestion.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/manual/command_tree.hpp"

namespace stageid {
namespace {

/// stageid help [COMMAND ...]: what `stageid COMMAND ... --help` prints.
class HelpCommand {
 public:
  /// Must be created after all other commands, because it completes their names.
  HelpCommand(CLI::App& app, Console& console);

 private:
  /// @throws std::invalid_argument for an unknown command, naming the nearest one
  void run() const;

  const CLI::App& app_;
  std::vector<std::string> words_;
};

HelpCommand::HelpCommand(CLI::App& app, Console&) : app_(app) {
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

}  // namespace

std::shared_ptr<void> help_command(CLI::App& app, Console& console) {
  return std::make_shared<HelpCommand>(app, console);
}

}  // namespace stageid
