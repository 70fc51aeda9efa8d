#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "acquisition/prediction/plant_prior.hpp"
#include "frf/response/frf_estimate.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Reads a prior from frf.h5 (a pilot) or model.json, at the requested frequencies, as sampled by a digital loop at
/// the rate of the stage.
///
/// A response is interpolated linearly between its lines. Below them it is a LowFrequencyPlant; above them it is
/// constant, up to 2 % beyond the last one. The noise is that of /residual_covariance, smoothed over 21 lines; it
/// requires the period, which is in the provenance of FRFs from `stageid frf`.
/// @param below_band_hz  ascending, below frequency_hz: frequencies of PlantPrior::below_band
/// @throws FileError, FormatError: neither file, a channel that is not in the stage, another sample rate, an FRF
/// without hold or with a narrower band.
PlantPrior read_plant_prior(const std::filesystem::path& file, const StageInfo& stage,
                            const Eigen::VectorXd& frequency_hz,
                            const Eigen::VectorXd& below_band_hz = {});

/// Covariance of the outputs' noise (DFT / N) in one period of a given length, by frequency, from /residual_covariance.
/// It is interpolated linearly, averaged over neighbouring lines if its degrees of freedom are few, and enlarged so that
/// its inverse is unbiased. Empty if the noise or the period of the FRF is unknown.
std::vector<Eigen::MatrixXcd> output_noise(const FrfEstimate& frf,
                                           const Eigen::VectorXd& frequency_hz, double period_s);

}  // namespace stageid
