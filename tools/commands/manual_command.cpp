#include "tools/commands/commands.hpp"

#include <filesystem>
#include <string>

#include "acquisition/files/output_file.hpp"
#include "acquisition/files/version.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/manual/command_tree.hpp"
#include "tools/manual/manual_pages.hpp"
#include "tools/manual/shell_completion.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// stageid manual -o DIR, with the commands that exist when it runs
void write_manual(const CLI::App& app, const std::filesystem::path& output, Console& console) {
  const CommandTree program = command_tree(app);
  const std::filesystem::path pages = output / "man" / "man1";
  const std::filesystem::path completions = output / "bash-completion" / "completions";
  require_directory(pages);
  const std::filesystem::path functions = output / "zsh" / "vendor-completions";
  require_directory(completions);
  require_directory(functions);
  Json written = Json::array();
  const auto write = [&](const std::filesystem::path& file, const std::string& text) {
    write_text_file(file, text);
    written.push_back(file.string());
  };
  for (const ManualPage& page : manual_pages(program, std::string(version())))
    write(pages / page.file, page.text);
  write(completions / program.name, bash_completion(program));
  write(functions / ("_" + program.name), zsh_completion(program));
  console.result("wrote {} files below {}", written.size(), output.string());
  console.result(Json{{"written", written}});
}

}  // namespace

void manual_command(CLI::App& app, Console& console) {
  const auto output = std::make_shared<std::filesystem::path>();
  CLI::App& command =
      add_command(app, "manual", "Write man pages and completions for bash and zsh");
  add_required(command, "-o,--output", *output,
               "directory such as /usr/share or ~/.local/share; the files go to its "
               "subdirectories man/man1, bash-completion/completions and zsh/vendor-completions");
  command.final_callback([output, &app, &console] { write_manual(app, *output, console); });
}

}  // namespace stageid
