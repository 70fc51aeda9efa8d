#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/terminal/console.hpp"

/// Of all options that are paths, in help and manual.
template <>
constexpr const char* CLI::detail::type_name<std::filesystem::path>() {
  return "FILE";
}

namespace stageid {

/// A subcommand that takes --json and --verbosity on either side of its name.
inline CLI::App& add_command(CLI::App& app, const std::string& name, const std::string& help) {
  CLI::App* command = app.add_subcommand(name, help);
  command->fallthrough();
  return *command;
}

/// The same, and the flags with which it calls `run`.
template <typename Flags>
std::pair<CLI::App&, Flags&> add_command(CLI::App& app, Console& console, const std::string& name,
                                         const std::string& help,
                                         void (*run)(const Flags&, Console&)) {
  CLI::App& command = add_command(app, name, help);
  const auto flags = std::make_shared<Flags>();
  command.final_callback([=, &console] { run(*flags, console); });
  return {command, *flags};
}

/// Rejects numbers below zero, or zero too, in words: CLI11 would print the largest double as upper bound.
inline CLI::Validator number_check(bool zero_is_one, const char* name) {
  const auto check = [zero_is_one](const std::string& text) -> std::string {
    double value = 0.0;
    if (CLI::detail::lexical_cast(text, value) && (zero_is_one ? value >= 0.0 : value > 0.0))
      return {};
    return "got '" + text + "'; expected a number " + (zero_is_one ? "of 0 or more" : "above 0");
  };
  return {check, name, ""};
}

/// For options >= 0.
inline const CLI::Validator kNotNegative = number_check(true, "NONNEGATIVE");
/// For options > 0.
inline const CLI::Validator kPositive = number_check(false, "POSITIVE");

inline CLI::Option* add_band(CLI::App& command, std::vector<double>& band_hz,
                             const std::string& otherwise) {
  return command.add_option("--band", band_hz, "LOW HIGH, Hz; default: " + otherwise)
      ->type_name("HZ")
      ->expected(2)
      ->check(kNotNegative);
}

/// An option or argument that must be given.
template <typename Value>
void add_required(CLI::App& command, const std::string& name, Value& value,
                  const std::string& help) {
  command.add_option(name, value, help)->required();
}

/// An option whose value has this name in help.
template <typename Value, typename... Checks>
CLI::Option* add_value(CLI::App& command, const std::string& name, Value& value, const char* type,
                       const std::string& help, const Checks&... checks) {
  CLI::Option* option = command.add_option(name, value, help)->type_name(type);
  (option->check(checks), ...);
  return option;
}

/// The same with a default, which help shows.
template <typename Value, typename... Checks>
CLI::Option* add_setting(CLI::App& command, const std::string& name, Value& value, const char* type,
                         const std::string& help, const Checks&... checks) {
  return add_value(command, name, value, type, help, checks...)->capture_default_str();
}

inline void add_threads(CLI::App& command, int& threads) {
  add_setting(command, "--threads", threads, "COUNT",
              "number of threads; 0: all cores. The result does not depend on it", kNotNegative);
}

inline void add_force(CLI::App& command, bool& force) {
  command.add_flag(
      "--force", force,
      "measure even if the design predicts that a limit is exceeded; limits still stop the run");
}

/// An option whose value is a word of the enumeration.
template <HasWords Enum>
void add_choice(CLI::App& command, const std::string& name, Enum& value, const std::string& help) {
  command
      .add_option_function<std::string>(
          name, [&value](const std::string& word) { value = *from_word<Enum>(word); }, help)
      ->check(CLI::IsMember(words_of<Enum>()))
      ->default_str(to_string(value));
}

/// For .mat files that the command writes.
inline void add_mat_version(CLI::App& command, MatVersion& version) {
  add_choice(command, "--mat-version", version, "version of a .mat file: 5 or 7.3 (HDF5)");
}

}  // namespace stageid
