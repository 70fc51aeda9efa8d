#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace stageid {

/// A subcommand that takes --json and --verbosity on either side of its name.
inline CLI::App* add_command(CLI::App& app, const std::string& name, const std::string& help) {
  CLI::App* command = app.add_subcommand(name, help);
  command->fallthrough();
  return command;
}

}  // namespace stageid
