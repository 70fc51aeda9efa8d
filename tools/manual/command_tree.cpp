#include "tools/manual/command_tree.hpp"

#include <algorithm>
#include <regex>

namespace stageid {
namespace {

/// The words that the parser accepts, from "TEXT:{periodic,lpm}".
std::vector<std::string> checked_words(const std::string& type) {
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}', open);
  if (open == std::string::npos || close == std::string::npos) return {};
  return CLI::detail::split(type.substr(open + 1, close - open - 1), ',');
}

/// The words in a help text such as "auto | none | how many | modes.json; default: ...".
std::vector<std::string> listed_words(const std::string& help) {
  static const std::regex word(R"(^([a-z][a-z_]*)( ?[(,:].*)?$)");
  std::vector<std::string> words;
  const std::string list = help.substr(0, help.find(';'));
  if (list.find(" | ") == std::string::npos) return words;
  for (std::string part : CLI::detail::split(list, '|')) {
    std::smatch match;
    CLI::detail::trim(part);
    if (std::regex_match(part, match, word) && std::ranges::find(words, match[1]) == words.end())
      words.push_back(match[1]);
  }
  return words;
}

/// What a value is, where the option does not say it.
std::string value_name(const std::string& type) {
  const std::string name = type.substr(0, type.find(':'));
  if (name == "TEXT") return "WORD";
  return name == "FLOAT" || name == "INT" ? "NUMBER" : name;
}

}  // namespace

CommandOption command_option(const CLI::Option& option) {
  CommandOption out;
  for (const std::string& name : option.get_snames()) out.flags.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.flags.push_back("--" + name);
  out.name = option.get_name(true);
  out.help = option.get_description();
  out.required = option.get_required();
  out.default_value = option.get_default_str();
  if (option.get_type_size() == 0) return out;
  const std::string type = option.get_type_name();
  out.value = value_name(type);
  out.words = checked_words(type);
  if (out.words.empty()) out.words = listed_words(out.help);
  out.repeats = option.get_expected_max() == CLI::detail::expected_max_vector_size;
  for (int k = 1; k < option.get_expected_min(); ++k) out.value += " " + value_name(type);
  return out;
}

CommandTree command_tree(const CLI::App& app) {
  CommandTree tree{app.get_name(), app.get_description(), app.get_footer(), {}, {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    CommandOption out = command_option(*option);
    (option->nonpositional() ? tree.options : tree.arguments).push_back(std::move(out));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    tree.commands.push_back(command_tree(*command));
  return tree;
}

std::vector<std::string> flags_of(const std::vector<CommandOption>& options) {
  std::vector<std::string> flags;
  for (const CommandOption& option : options)
    flags.insert(flags.end(), option.flags.begin(), option.flags.end());
  return flags;
}

std::vector<std::string> names_of(const std::vector<CommandTree>& commands) {
  std::vector<std::string> names;
  for (const CommandTree& command : commands) names.push_back(command.name);
  return names;
}

}  // namespace stageid
