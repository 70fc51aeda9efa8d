#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid run CONFIG -o run.slog
class RunCommand {
 public:
  RunCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path config_;
  std::filesystem::path output_;
  std::string backend_;
  std::filesystem::path replay_;
  double replay_tolerance_n_ = 1e-9;
  double pace_ = -1.0;
  std::filesystem::path excitation_;
  double until_ = 0.0;
  std::string dashboard_;
  bool resume_ = false;
  bool reset_fault_ = false;
};

}  // namespace stageid
