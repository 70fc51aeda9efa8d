#pragma once

#include <filesystem>
#include <vector>

#include "tools/report/report_page.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// Files for a report; each may be missing.
struct ReportInput {
  std::filesystem::path frf;
  std::filesystem::path validation_frf;
  std::filesystem::path model;
  std::filesystem::path model_h5;  ///< for the confidence band
  std::filesystem::path modes;
  std::filesystem::path log;
  std::filesystem::path summary;
  std::filesystem::path controller_view;
  std::filesystem::path stage;  ///< for the positions; default: the one in the log
  bool all_lines = false;       ///< show those outside the band of the model too
};

/// Sorts files (or the files of a directory of `identify`) by their content.
/// @throws std::invalid_argument for an unsupported file, or two of the same kind.
ReportInput report_input(const std::vector<std::filesystem::path>& files);

/// Completes a page: the response, the verdicts on linearity and the health findings in the FRF (computed if it has
/// none), poles over orders, log, stage and summary.
/// @param input log and stage are read; the file of the summary is only named in errors
/// @param summary of `identify`; null: none
/// @throws FileError, FormatError, std::invalid_argument
void complete_report(ReportData& data, const ReportInput& input, const Json& summary);

/// A result of files for comparison; each part may be missing, but not both.
struct ComparedResult {
  std::string title;  ///< name of the first file or directory
  std::optional<AdditiveModel> model;
  std::optional<FrfEstimate> frf;
};
/// @throws as report_input(); std::invalid_argument if there is neither an FRF nor a model
ComparedResult read_compared(const std::vector<std::filesystem::path>& files);

/// The response data of files. @throws FileError, FormatError, std::invalid_argument
ReportData read_response_data(const ReportInput& input);

/// Everything in the files. @throws as read_response_data()
ReportData read_report_data(const ReportInput& input);

/// Adds another day or model: a directory of `identify`, or its FRF and model.
/// @throws as report_input() and report::make_comparison(); std::invalid_argument if neither exists.
void add_comparison(ReportData& data, const std::vector<std::filesystem::path>& files);

}  // namespace stageid
