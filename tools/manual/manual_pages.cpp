#include "tools/manual/manual_pages.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace stageid {
namespace {

/// Escapes text for roff: a backslash begins an escape, an unescaped hyphen is typographic, and a line that begins
/// with a dot or an apostrophe is a request.
std::string roff(const std::string& text) {
  std::string out;
  bool line_begins = true;
  for (const char c : text) {
    if (line_begins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if (c == '\'')
      out += "\\(aq";
    else
      out += c;
    line_begins = c == '\n';
  }
  return out;
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
  return text;
}

std::string value_text(const CommandOption& option) {
  if (option.value.empty()) return "";
  return fmt::format(" \\fI{}\\fR{}", roff(option.value), option.repeats ? " ..." : "");
}

std::string synopsis(const std::string& path, const CommandTree& command) {
  std::string out = fmt::format(".B {}\n[\\fIOPTIONS\\fR]", roff(path));
  for (const CommandOption& option : command.options)
    if (option.required)
      out += fmt::format(" \\fB{}\\fR{}", roff(option.flags.front()), value_text(option));
  for (const CommandOption& argument : command.arguments) {
    const std::string name =
        fmt::format("\\fI{}\\fR{}", roff(argument.name), argument.repeats ? " ..." : "");
    out += argument.required ? " " + name : " [" + name + "]";
  }
  if (!command.commands.empty()) out += " \\fICOMMAND\\fR ...";
  return out + "\n";
}

std::string item(const CommandOption& option) {
  std::string head;
  for (const std::string& flag : option.flags)
    head += fmt::format("{}\\fB{}\\fR", head.empty() ? "" : ", ", roff(flag));
  if (option.flags.empty())
    head = fmt::format("\\fI{}\\fR{}", roff(option.name), option.repeats ? " ..." : "");
  else
    head += value_text(option);
  std::string text = roff(option.help);
  if (!option.default_value.empty()) text += fmt::format(" [{}]", roff(option.default_value));
  if (option.required && !option.flags.empty()) text += " (required)";
  return fmt::format(".TP\n{}\n{}\n", head, text);
}

std::string items(const std::string& section, const std::vector<CommandOption>& options) {
  if (options.empty()) return "";
  std::string out = section;
  for (const CommandOption& option : options) out += item(option);
  return out;
}

std::string page(const std::string& path, const CommandTree& command, const CommandTree& program,
                 const std::string& version) {
  std::string name = path;
  std::replace(name.begin(), name.end(), ' ', '-');
  std::string out = fmt::format(".TH {} 1 \"\" \"stageid {}\" \"User Commands\"\n",
                                roff(upper(name)), roff(version));
  out += fmt::format(".SH NAME\n{} \\- {}\n", roff(name), roff(command.help));
  out += ".SH SYNOPSIS\n" + synopsis(path, command);
  out += items(".SH ARGUMENTS\n", command.arguments);
  out += items(".SH OPTIONS\n", command.options);
  if (&command != &program)
    out += ".PP\n\\fB\\-\\-json\\fR and \\fB\\-\\-verbosity\\fR, see \\fBstageid\\fR(1).\n";
  if (!command.commands.empty()) out += ".SH COMMANDS\n";
  for (const CommandTree& sub : command.commands) {
    if (&command == &program) {
      out += fmt::format(".TP\n\\fB{}\\fR\n{}: see \\fBstageid\\-{}\\fR(1)\n", roff(sub.name),
                         roff(sub.help), roff(sub.name));
      continue;
    }
    out += fmt::format(".SS {} {}\n{}\n.PP\n", roff(path), roff(sub.name), roff(sub.help));
    out += synopsis(path + " " + sub.name, sub) + items("", sub.arguments) + items("", sub.options);
  }
  out += ".SH EXIT STATUS\n" + roff(program.footer) + "\n";
  out += ".SH SEE ALSO\n";
  if (&command != &program) return out + "\\fBstageid\\fR(1)\n";
  for (std::size_t k = 0; k < program.commands.size(); ++k)
    out += fmt::format("{}\\fBstageid\\-{}\\fR(1)", k == 0 ? "" : ", ",
                       roff(program.commands[k].name));
  return out + "\n";
}

}  // namespace

std::vector<ManualPage> manual_pages(const CommandTree& program, const std::string& version) {
  std::vector<ManualPage> pages = {
      {program.name + ".1", page(program.name, program, program, version)}};
  for (const CommandTree& command : program.commands)
    pages.push_back({fmt::format("{}-{}.1", program.name, command.name),
                     page(program.name + " " + command.name, command, program, version)});
  return pages;
}

}  // namespace stageid
