#pragma once

// FILE.h5 of an exported model: docs/formats.md.

#include <Eigen/Core>
#include <filesystem>
#include <optional>

#include "estimation/modal/modal_form.hpp"

namespace stageid {

/// The response belonging to an exported model; all members may be empty.
struct ExportedResponse {
  Eigen::VectorXd frequency_hz;
  Eigen::MatrixXd variance;  ///< (n_y n_u) x N or 0 x 0
};

/// Writes model.h5 atomically.
/// @param driving_point for /modes/driving_point_mass
/// @throws std::invalid_argument as state_space(), rigid_body() and driving_point_mass().
/// @throws FileError
void write_model_hdf5(const std::filesystem::path& file, const AdditiveModel& model,
                      const ExportedResponse& response,
                      const std::optional<DrivingPoint>& driving_point);

/// /response_variance of an exported model if its lines are `frequency_hz`; else 0 x 0.
/// @throws FileError, FormatError
Eigen::MatrixXd read_response_variance(const std::filesystem::path& file,
                                       const Eigen::VectorXd& frequency_hz);

}  // namespace stageid
