#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

/// A property of a stage that may change while the stage works.
enum class TrackedKind : std::uint8_t { frequency, damping, sensor_gain, actuator_gain, delay };
template <>
inline constexpr std::array kWords<TrackedKind> = {"frequency", "damping", "sensor_gain",
                                                   "actuator_gain", "delay"};

/// One tracked property. Its value is the change from the model: relative, for a delay in seconds.
struct TrackedParameter {
  TrackedKind kind = TrackedKind::frequency;
  Eigen::Index index = 0;  ///< submodel, sensor or actuator; delay: 0, common to all channels
};

/// Frequency and damping ratio of every mode in the band that the data of the model determine, gains of all sensors and
/// actuators, and the delay.
std::vector<TrackedParameter> tracked_parameters(const AdditiveModel& model,
                                                 const std::array<double, 2>& band_hz);

/// "frequency of the mode at 752.68 Hz", "gain of sensor 'y1'".
std::string describe(const TrackedParameter& parameter, const AdditiveModel& model);

/// Its value in the model: a natural frequency in Hz, a damping ratio, 1 for a gain, 0 for the delay.
double nominal_value(const TrackedParameter& parameter, const AdditiveModel& model);

/// The largest change of a stage that still works, one standard deviation: 5 % of a frequency, 50 % of a damping ratio,
/// 30 % of a gain, one sample of delay. It only matters for what the data do not determine.
Eigen::VectorXd largest_changes(const std::vector<TrackedParameter>& parameters,
                                double sample_rate_hz);

/// Information of the tracked parameters without data, q x q: that of largest_changes(). A common factor of all sensors
/// and its inverse of all actuators cannot be distinguished; it is held at one.
Eigen::MatrixXd prior_information(const std::vector<TrackedParameter>& parameters,
                                  double sample_rate_hz);

/// The submodel with its frequency multiplied by 1 + frequency and its damping ratio by 1 + damping. The numerators of
/// N(s) / (s^2 + 2 zeta omega s + omega^2) stay: the stiffness changes, masses and shapes do not.
Submodel moved(const Submodel& mode, double frequency, double damping);

}  // namespace stageid
