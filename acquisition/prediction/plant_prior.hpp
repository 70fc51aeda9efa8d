#pragma once

#include <Eigen/Core>
#include <vector>

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

}  // namespace stageid
