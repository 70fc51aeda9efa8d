#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "tools/exchange/import/import_summary.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid import FILE.{unv,uff,mat,csv,h5,npz,sNp} -o frf.h5|run.slog [--map MAP.yaml]; without -o it lists the
/// content of the file.
class ImportCommand {
 public:
  ImportCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  void list() const;
  void require_input() const;
  ImportSummary import_with_map() const;

  Console& console_;
  std::filesystem::path input_;
  std::filesystem::path output_;
  std::filesystem::path map_;
};

}  // namespace stageid
