#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid export MODEL|FRF -o FILE.{json,h5,csv,mat,npz,unv,uff,py,m}
class ExportCommand {
 public:
  ExportCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  void export_from_model() const;
  void export_from_frf() const;

  Console& console_;
  std::filesystem::path input_;
  std::filesystem::path output_;
  std::filesystem::path frf_;
  std::vector<std::string> driving_point_;
  MatVersion mat_version_ = MatVersion::v5;
};

}  // namespace stageid
