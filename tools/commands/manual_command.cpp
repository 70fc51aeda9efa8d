#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "acquisition/files/output_file.hpp"
#include "acquisition/files/version.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/manual/command_tree.hpp"
#include "tools/manual/manual_pages.hpp"
#include "tools/manual/shell_completion.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// stageid manual -o DIR
class ManualCommand {
 public:
  /// The commands of `app` are read when this command runs, because all of them exist by then.
  ManualCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  const CLI::App& app_;
  Console& console_;
  std::filesystem::path output_;
};

ManualCommand::ManualCommand(CLI::App& app, Console& console) : app_(app), console_(console) {
  CLI::App* command =
      add_command(app, "manual", "Write man pages and completions for bash and zsh");
  command
      ->add_option("-o,--output", output_,
                   "directory such as /usr/share or ~/.local/share; the files go to man/man1, "
                   "bash-completion/completions and zsh/vendor-completions in it")
      ->required();
  command->final_callback([this] { run(); });
}

void ManualCommand::run() const {
  const CommandTree program = command_tree(app_);
  const std::filesystem::path pages = output_ / "man" / "man1";
  const std::filesystem::path completions = output_ / "bash-completion" / "completions";
  require_directory(pages);
  const std::filesystem::path functions = output_ / "zsh" / "vendor-completions";
  require_directory(completions);
  require_directory(functions);
  nlohmann::ordered_json written = nlohmann::ordered_json::array();
  const auto write = [&](const std::filesystem::path& file, const std::string& text) {
    write_text_file(file, text);
    written.push_back(file.string());
  };
  for (const ManualPage& page : manual_pages(program, std::string(version())))
    write(pages / page.file, page.text);
  write(completions / program.name, bash_completion(program));
  write(functions / ("_" + program.name), zsh_completion(program));
  console_.result(fmt::format("wrote {} files below {}", written.size(), output_.string()));
  console_.result(nlohmann::ordered_json{{"written", written}});
}

}  // namespace

std::shared_ptr<void> manual_command(CLI::App& app, Console& console) {
  return std::make_shared<ManualCommand>(app, console);
}

}  // namespace stageid
