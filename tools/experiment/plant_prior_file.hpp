#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "acquisition/prediction/plant_prior.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Reads a prior from frf.h5 (a pilot's) or model.json, onto the lines asked for, as a digital loop of
/// the stage's rate sees the plant.
///
/// A response is interpolated linearly between its own lines; below them it is a LowFrequencyPlant, above
/// them it is held, up to 2 % more. The noise is that of /residual_covariance, smoothed over
/// 21 lines; it needs the period that stands in the provenance of FRFs made by `stageid frf`.
/// @param below_band_hz  ascending, below frequency_hz: where PlantPrior::below_band is wanted
/// @throws FileError, FormatError: neither file, a channel that the stage lacks, another sample rate, an FRF
///         without hold or of a narrower band.
PlantPrior read_plant_prior(const std::filesystem::path& file, const StageInfo& stage,
                            const Eigen::VectorXd& frequency_hz,
                            const Eigen::VectorXd& below_band_hz = {});

}  // namespace stageid
