#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid log info | verify | recover | convert FILE ...
class LogCommand {
 public:
  LogCommand(CLI::App& app, Console& console);

 private:
  void info() const;
  void verify() const;
  void recover() const;
  void convert() const;

  Console& console_;
  std::filesystem::path file_;
  std::filesystem::path output_;
  bool complete_only_ = false;
  MatVersion mat_version_ = MatVersion::v5;
  bool health_ = false;
  std::filesystem::path stage_;
};

}  // namespace stageid
