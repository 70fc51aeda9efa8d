#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tools/report/report.hpp"

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

/// What a page and a picture show of the response: the FRF within the model's band, the model's response and error
/// on its lines, what was held back, validation, CMIF curves, chosen modes.
/// @throws FileError, FormatError, std::invalid_argument
ReportData read_response_data(const ReportInput& input);

/// Reads everything: the response, the verdicts on linearity and the findings on the data's health that the FRF
/// holds (verdicts are computed where a file has none), poles over orders, log and summary.
/// @throws as read_response_data()
ReportData read_report_data(const ReportInput& input);

/// Adds another day or model: a directory of `identify`, or its FRF and model.
/// @throws as report_input() and report::make_comparison(); std::invalid_argument if neither is there.
void add_comparison(ReportData& data, const std::vector<std::filesystem::path>& files);

}  // namespace stageid
