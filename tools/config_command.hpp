#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/console.hpp"

namespace stageid {

/// stageid config schema | check FILE...
class ConfigCommand {
 public:
  ConfigCommand(CLI::App& app, Console& console);

 private:
  void schema() const;
  void check() const;

  Console& console_;
  std::string kind_;
  std::vector<std::filesystem::path> files_;
};

}  // namespace stageid
