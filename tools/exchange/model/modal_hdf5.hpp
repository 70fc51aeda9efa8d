#pragma once

#include <optional>

#include "acquisition/files/hdf5_file.hpp"
#include "estimation/modal/modal_form.hpp"

namespace stageid {

/// /modes and /rigid_body of an exported model, as in docs/formats.md.
/// @throws std::invalid_argument as rigid_body() and driving_point_mass(). @throws FileError
void write_modal_form(Hdf5File& file, const AdditiveModel& model,
                      const std::optional<DrivingPoint>& driving_point);

/// /state_space/continuous and, if the sample rate is known, /state_space/discrete.
/// @throws std::invalid_argument as state_space(). @throws FileError
void write_state_spaces(Hdf5File& file, const AdditiveModel& model);

}  // namespace stageid
