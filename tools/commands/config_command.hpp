#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/config/stage_config.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid config schema | check FILE... | dbc STAGE -o FILE | header STAGE -o FILE
class ConfigCommand {
 public:
  ConfigCommand(CLI::App& app, Console& console);

 private:
  void schema() const;
  void check() const;
  void check(const std::filesystem::path& file) const;
  void dbc() const;
  void header() const;
  StageConfig can_stage() const;
  void write(const std::string& text) const;

  Console& console_;
  std::string kind_;
  std::vector<std::filesystem::path> files_;
  std::filesystem::path stage_file_;
  std::filesystem::path output_;
};

}  // namespace stageid
