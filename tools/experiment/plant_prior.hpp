#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "hal/stage/stage.hpp"

namespace stageid {

/// What is known of a plant before it is measured: on some lines, channels as the stage has them.
struct PlantPrior {
  std::vector<Eigen::MatrixXcd> response;  ///< a line: sensors x actuators; 0 where unknown
  std::vector<bool> sensor_known;
  std::vector<bool> actuator_known;
  /// The same on the frequencies below the band that were asked for.
  std::vector<Eigen::MatrixXcd> below_band;
  double extrapolated_below_hz =
      0.0;                            ///< 0: the prior has lines, or a model, wherever it was asked
  double extrapolation_misfit = 0.0;  ///< of LowFrequencyPlant
  /// E|V|^2 N / fs of the output noise V (DFT / N of a period of N samples), unit of output^2 / Hz,
  /// sensors x lines; empty: unknown.
  Eigen::MatrixXd noise_density;
};

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
