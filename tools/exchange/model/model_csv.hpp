#pragma once

#include <string>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// A model as a table. Lines that begin with # contain the format, version and channels. Then one line per
/// coefficient: submodel, integrators, natural_frequency_hz, natural_frequency_std_hz, damping_ratio,
/// damping_ratio_std, power_of_s, output, input, coefficient. SI units, s in rad/s:
///   P(s) = sum over submodels of  coefficient s^power / (s^integrators A(s)),
///   A(s) = 1 + 2 zeta s/omega + s^2/omega^2, or 1 if the frequency is empty.
/// @throws std::invalid_argument if a submodel is neither a mode nor an integrator.
std::string model_csv(const AdditiveModel& model);

}  // namespace stageid
