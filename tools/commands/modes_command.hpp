#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid modes FRF [-o modes.json]
class ModesCommand {
 public:
  ModesCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path frf_;
  std::filesystem::path output_;
  std::vector<double> band_hz_;
  std::string kind_ = "accelerance";
  double prominence_db_ = 3.0;
};

}  // namespace stageid
