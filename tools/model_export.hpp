#pragma once

// Exported models.
//
// FILE.h5
//   /                 attributes: format = "stageid-model", format_version = 1, sample_rate_hz (0 if
//                     unknown), hold
//   /inputs, /outputs strings; attribute unit: one string a channel
//   /input_delay_s [n_u]   /output_delay_s [n_y]
//   /model_json       strings [1]: model.json whole
//   /submodels/0000 ...    attribute integrators; denominator [n + 1], numerator [m + 1 x n_y x n_u]
//   /modes/natural_frequency_hz, damping_ratio, natural_frequency_std_hz, damping_ratio_std [K]
//                     (standard deviations: NaN if unknown), submodel [K]: index into /submodels
//   /frequency_hz [N] /response [N x n_y x n_u] complex (r, i): through the model's hold and delays
//   /response_variance [N x n_y x n_u]     E|dP|^2 from the parameter covariance; absent if unknown
//
// FILE.csv
//   Lines that begin with # tell the format, version and channels. Then one line a coefficient:
//   submodel, integrators, natural_frequency_hz, natural_frequency_std_hz, damping_ratio,
//   damping_ratio_std, power_of_s, output, input, coefficient. SI units, s in rad/s:
//   P(s) = sum over submodels of  coefficient s^power / (s^integrators A(s)),
//   A(s) = 1 + 2 zeta s/omega + s^2/omega^2, or 1 where the frequency is empty.

#include <Eigen/Core>
#include <filesystem>

#include "estimation/additive_model.hpp"

namespace stageid {

/// The response that goes with an exported model; all may be empty.
struct ExportedResponse {
  Eigen::VectorXd frequency_hz;
  Eigen::MatrixXd variance;  ///< (n_y n_u) x N or 0 x 0
};

/// Writes by the extension of `file`: .json, .h5, .hdf5, .csv.
/// @throws std::invalid_argument for another extension, listing those there are, and for a model that
/// the format cannot hold. @throws FileError
void export_model(const std::filesystem::path& file, const AdditiveModel& model,
                  const ExportedResponse& response);

/// @throws std::invalid_argument as export_model(), before any work is done.
void require_export_format(const std::filesystem::path& file);

/// /response_variance of an exported model if its lines are `frequency_hz`; else 0 x 0.
/// @throws FileError, FormatError
Eigen::MatrixXd read_response_variance(const std::filesystem::path& file,
                                       const Eigen::VectorXd& frequency_hz);

}  // namespace stageid
