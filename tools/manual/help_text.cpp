#include "tools/manual/help_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <sstream>

#include "tools/manual/command_tree.hpp"

namespace stageid {
namespace {

constexpr std::size_t kIndent = 30;  // of the text behind a head
constexpr std::size_t kLeastText = 30;

std::string names_of(const std::set<CLI::Option*>& options) {
  std::string names;
  for (const CLI::Option* option : options)
    names += (names.empty() ? "" : ", ") + option->get_name();
  return names;
}

}  // namespace

std::string HelpText::entry(const std::string& head, const std::string& text) const {
  std::string out = "  " + head;
  std::size_t column = out.size();
  const std::size_t end = std::max(width_, kIndent + kLeastText);
  std::istringstream words(text);
  bool first = true;
  for (std::string word; words >> word; first = false) {
    if ((first && column + 2 > kIndent) || (!first && column + 1 + word.size() > end)) {
      out += '\n';
      column = 0;
    }
    const std::size_t space = column < kIndent ? kIndent - column : 1;
    out += std::string(space, ' ') + word;
    column += space + word.size();
  }
  return out + "\n";
}

std::string HelpText::make_option(const CLI::Option* option, bool /*is_positional*/) const {
  const CommandOption shown = command_option(*option);
  std::string head =
      shown.flags.empty() ? shown.name : fmt::format("{}", fmt::join(shown.flags, ","));
  if (!shown.flags.empty() && !shown.value.empty()) head += " " + shown.value;
  if (shown.repeats) head += " ...";
  std::string text = shown.help;
  if (!shown.default_value.empty()) text += fmt::format(" [{}]", shown.default_value);
  if (!option->get_needs().empty())
    text += fmt::format(" (only with {})", names_of(option->get_needs()));
  if (!option->get_excludes().empty())
    text += fmt::format(" (not with {})", names_of(option->get_excludes()));
  if (shown.required && !shown.flags.empty()) text += " (required)";
  if (!shown.required && shown.flags.empty()) text += " (optional)";
  return entry(head, text);
}

std::string HelpText::make_subcommand(const CLI::App* command) const {
  return entry(command->get_name(), command->get_description());
}

std::size_t help_columns() {
  winsize size{};
  if (isatty(STDOUT_FILENO) == 0 || ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 ||
      size.ws_col == 0)
    return 100;
  return std::min<std::size_t>(size.ws_col, 120);
}

}  // namespace stageid
