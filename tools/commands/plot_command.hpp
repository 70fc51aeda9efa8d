#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/plot/picture.hpp"
#include "tools/report/report.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid plot {cmif|bode|entry} FRF [MODEL] -o FILE.{pdf,svg,png}
class PlotCommand {
 public:
  PlotCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  Picture picture(const ReportData& data) const;
  Picture cmif(const ReportData& data) const;
  Picture entry(const ReportData& data) const;

  Console& console_;
  std::string figure_;
  std::vector<std::filesystem::path> inputs_;
  std::vector<std::string> output_channels_;
  std::vector<std::string> input_channels_;
  std::filesystem::path output_;
};

}  // namespace stageid
