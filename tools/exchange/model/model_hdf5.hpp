#pragma once

// FILE.h5 of an exported model: docs/formats.md.

#include <Eigen/Core>
#include <filesystem>
#include <optional>

#include "acquisition/files/hdf5_matrices.hpp"
#include "estimation/modal/mode_shapes.hpp"
#include "frf/file/line_datasets.hpp"

namespace stageid {

/// The response belonging to an exported model; all members may be empty.
struct ExportedResponse {
  Eigen::VectorXd frequency_hz;
  Eigen::MatrixXd variance;  ///< (n_y n_u) x N or 0 x 0
};

// Parts of files of a model.

/// /inputs and /outputs with their units.
void write_channels(Hdf5File& file, const AdditiveModel& model);
/// /frequency_hz and /response.
void write_response(Hdf5File& file, const AdditiveModel& model,
                    const Eigen::VectorXd& frequency_hz);

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
