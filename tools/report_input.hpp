#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tools/report.hpp"

namespace stageid {

/// Files that a report is made of; each may be missing.
struct ReportInput {
  std::filesystem::path frf;
  std::filesystem::path validation_frf;
  std::filesystem::path model;
  std::filesystem::path model_h5;  ///< for the confidence band
  std::filesystem::path modes;
  std::filesystem::path log;
  std::filesystem::path summary;
  std::filesystem::path stage;  ///< for the positions; without it those of the log
};

/// Sorts files (or the files of a directory of `identify`) by what they hold.
/// @throws std::invalid_argument for a file that is none of these, or twice the same kind.
ReportInput report_input(const std::vector<std::filesystem::path>& files);

/// Reads everything and computes what belongs together: the model's response and error on the lines
/// of the FRF within the model's band, CMIF curves, validation.
/// @throws FileError, FormatError, std::invalid_argument
ReportData read_report_data(const ReportInput& input);

/// Adds another day or model: a directory of `identify`, or its FRF and model.
/// @throws as report_input() and report::make_comparison(); std::invalid_argument if neither is there.
void add_comparison(ReportData& data, const std::vector<std::filesystem::path>& files);

}  // namespace stageid
