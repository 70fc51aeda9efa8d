#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace stageid {

/// The configured properties of a stage, for comparison with a log.
struct NominalStage {
  std::vector<std::string> actuators;
  std::vector<std::string> sensors;
  double sample_rate_hz = 0.0;              ///< 0: unknown
  std::vector<std::string> actuator_units;  ///< of the first names; those of others are unknown
  std::vector<std::string> sensor_units;    ///< likewise
  /// -C(e^{j omega T}) from y to u, actuators x sensors; empty: unknown, the stage closes the loop itself.
  std::function<Eigen::MatrixXcd(double frequency_hz)> controller;
  double controller_from_hz = 0.0;  ///< band in which it is known
  double controller_to_hz = std::numeric_limits<double>::infinity();
  double controller_error = 1e-3;  ///< permitted relative error of C y
  /// The rigid body alone through hold, delay and sampler, sensors x actuators; empty: unknown.
  std::function<Eigen::MatrixXcd(double frequency_hz)> rigid_body;
  double free_from_hz = 0.0;  ///< above it the suspension is negligible
};

/// Index of each of `names` in `nominal`. @returns empty if one is missing; `missing`, if given, names it.
std::vector<Eigen::Index> positions_in(const std::vector<std::string>& nominal,
                                       const std::vector<std::string>& names,
                                       std::string* missing = nullptr);

}  // namespace stageid
