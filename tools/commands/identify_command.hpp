#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid identify CONFIG -o DIR
class IdentifyCommand {
 public:
  IdentifyCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path config_;
  std::filesystem::path output_;
  bool resume_ = false;
  bool force_ = false;
  int threads_ = 0;
};

}  // namespace stageid
