#pragma once

// Exported models and frequency responses, by file extension; docs/exchange.md.
//
//   .json        the model                        .h5, .hdf5   tools/exchange/model/model_hdf5.hpp
//   .csv         a table, frf_csv.hpp             .npz, .mat   the content of .h5 for numpy and MATLAB
//   .unv, .uff   tools/exchange/uff/uff_frf.hpp, text and binary: response and modes
//   .py, .m      tools/exchange/model/model_script.hpp          .h    model_code.hpp, C99

#include <filesystem>
#include <optional>

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/model/model_hdf5.hpp"

namespace stageid {

/// @throws std::invalid_argument for an unsupported extension, listing the supported ones, and for a model that cannot
/// be stored in the format (.csv: submodels that are not modes; state spaces: those without one; .unv: too long names
/// or units, no frequencies).
/// @throws FileError
void export_model(const std::filesystem::path& file, const AdditiveModel& model,
                  const ExportedResponse& response,
                  const std::optional<DrivingPoint>& driving_point = {},
                  MatVersion mat_version = MatVersion::v5);

/// @pre the ending is .mat, .npz, .csv, .unv or .uff. @throws as export_model().
void export_frf(const std::filesystem::path& file, const FrfEstimate& frf,
                MatVersion mat_version = MatVersion::v5);

/// @throws std::invalid_argument as export_model(), before any work is done.
void require_export_format(const std::filesystem::path& file);

}  // namespace stageid
