#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/console.hpp"

namespace stageid {

/// stageid export MODEL -o FILE.{json,h5,csv}
class ExportCommand {
 public:
  ExportCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path model_;
  std::filesystem::path output_;
  std::filesystem::path frf_;
  std::vector<std::string> driving_point_;
};

}  // namespace stageid
