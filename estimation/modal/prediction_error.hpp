#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "estimation/model/additive_model.hpp"

namespace stageid {

/// Error of the prediction of the sensors of a log from its actuators by a model, sample by sample, in a band.
struct PredictionError {
  std::vector<std::string> sensors;
  Eigen::VectorXd error_rms;   ///< of the predicted minus the measured signal, unit of the sensor
  Eigen::VectorXd signal_rms;  ///< of the measured signal in the band
  int runs = 0;
  double band_hz[2] = {0.0, 0.0};
  /// sqrt(sum of squared errors / sum of squared signals), with equal weights for all sensors.
  double normalized() const;
};

/// In steady state over whole periods, so the simulation is exact line by line:
///   y_hat(n) = sum over lines l of the band of  P(j omega_l) U(l) e^{j 2 pi l n / N},
/// P through the model's hold and delays; mean squares by Parseval. Lines outside the band (above all the drift
/// of a free stage) are removed from prediction and measurement alike. Actuators that are not inputs of the model
/// are assumed to be zero.
/// @throws std::invalid_argument if the log lacks a channel of the model, or has no line in the band.
PredictionError prediction_error(const AdditiveModel& model, const LogReader& log, double low_hz,
                                 double high_hz);

}  // namespace stageid
