#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <vector>

#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid report DIR|FILE... -o report.html
class ReportCommand {
 public:
  ReportCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::vector<std::filesystem::path> inputs_;
  std::vector<std::filesystem::path> compare_;
  std::filesystem::path output_;
};

}  // namespace stageid
