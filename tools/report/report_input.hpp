#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "tools/report/report.hpp"

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
  std::filesystem::path stage;  ///< for the positions; default: the one in the log
};

/// Sorts files (or the files of a directory of `identify`) by their content.
/// @throws std::invalid_argument for an unsupported file, or two of the same kind.
ReportInput report_input(const std::vector<std::filesystem::path>& files);

/// The results that pages and pictures are made of, from files or from the job that computed them; each may be missing.
struct ReportParts {
  std::optional<FrfEstimate> frf;
  std::optional<FrfEstimate> validation_frf;
  std::optional<AdditiveModel> model;
  Eigen::MatrixXd model_variance;  ///< (n_y n_u) x lines of the FRF in the band of the model
  std::vector<ModeCandidate> chosen_modes;
  std::filesystem::path log;
  std::filesystem::path stage;
  std::filesystem::path summary_file;  ///< named in errors
  nlohmann::ordered_json summary;      ///< of `identify`; null: none
};

/// @throws FileError, FormatError, std::invalid_argument
ReportParts read_report_parts(const ReportInput& input);

/// The response data of pages and pictures: the FRF within the band of the model, response and error of the model on
/// its lines, held-back data, validation, CMIF curves, chosen modes.
/// @throws FileError, FormatError, std::invalid_argument
ReportData response_data(ReportParts parts);

/// Everything: the response, the verdicts on linearity and the health findings in the FRF (computed if the file has
/// none), poles over orders, log and summary.
/// @throws as response_data()
ReportData report_data(ReportParts parts);

/// Adds another day or model: a directory of `identify`, or its FRF and model.
/// @throws as report_input() and report::make_comparison(); std::invalid_argument if neither exists.
void add_comparison(ReportData& data, const std::vector<std::filesystem::path>& files);

}  // namespace stageid
