#pragma once

// Exported models.
//
// FILE.h5: tools/model_hdf5.hpp.
//
// FILE.csv
//   Lines that begin with # tell the format, version and channels. Then one line a coefficient:
//   submodel, integrators, natural_frequency_hz, natural_frequency_std_hz, damping_ratio,
//   damping_ratio_std, power_of_s, output, input, coefficient. SI units, s in rad/s:
//   P(s) = sum over submodels of  coefficient s^power / (s^integrators A(s)),
//   A(s) = 1 + 2 zeta s/omega + s^2/omega^2, or 1 where the frequency is empty.

#include <filesystem>
#include <optional>

#include "tools/model_hdf5.hpp"

namespace stageid {

/// Writes by the extension of `file`: .json, .h5, .hdf5, .csv.
/// @throws std::invalid_argument for another extension, listing those there are, and for a model that
/// the format cannot hold (.csv: submodels that are no modes; .h5: those without a state space).
/// @throws FileError
void export_model(const std::filesystem::path& file, const AdditiveModel& model,
                  const ExportedResponse& response,
                  const std::optional<DrivingPoint>& driving_point = {});

/// @throws std::invalid_argument as export_model(), before any work is done.
void require_export_format(const std::filesystem::path& file);

}  // namespace stageid
