#pragma once

#include <string>

#include "estimation/model/additive_model.hpp"

namespace stageid {

enum class ScriptLanguage : unsigned char { python, matlab };

/// A program that holds a model and needs nothing else: state space, continuous and (if the sample rate is
/// known) sampled, delays, modes, and a function that computes the response through the model's hold; run
/// by itself it plots it. Python needs numpy (matplotlib for the plot), MATLAB and Octave no toolbox.
/// Numbers are written such that they read back to the same double.
/// @param function of the .m file
/// @throws std::invalid_argument as state_space().
std::string model_script(const AdditiveModel& model, ScriptLanguage language,
                         const std::string& function);

}  // namespace stageid
