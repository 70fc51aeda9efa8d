#pragma once

#include <Eigen/Core>
#include <vector>

namespace stageid {

/// Knowledge of a plant before its measurement: on some lines, channels as in the stage.
struct PlantPrior {
  std::vector<Eigen::MatrixXcd> response;  ///< per line: sensors x actuators; 0 if unknown
  std::vector<bool> sensor_known;
  std::vector<bool> actuator_known;
  /// The same at the requested frequencies below the band.
  std::vector<Eigen::MatrixXcd> below_band;
  /// 0: the prior has lines, or a model, at all requested frequencies
  double extrapolated_below_hz = 0.0;
  double extrapolation_misfit = 0.0;  ///< of LowFrequencyPlant
  /// E|V|^2 N / fs of the output noise V (DFT / N of a period of N samples), unit of output^2 / Hz,
  /// sensors x lines; empty: unknown.
  Eigen::MatrixXd noise_density;
};

}  // namespace stageid
