#pragma once

#include <string>

#include "estimation/model/additive_model.hpp"

namespace stageid {

enum class ScriptLanguage : unsigned char { python, matlab };

/// A self-contained program with a model: state space, continuous and (if the sample rate is known) sampled, delays,
/// modes, and a function that computes the response through the hold of the model. Run as a script, it plots the
/// response. Python needs numpy (matplotlib for the plot), MATLAB and Octave no toolbox; with MATLAB's toolboxes it
/// also builds ss, idss, idfrd and uss. Numbers read back to the same
/// double.
/// @param function of the .m file
/// @throws std::invalid_argument as state_space().
std::string model_script(const AdditiveModel& model, ScriptLanguage language,
                         const std::string& function);

}  // namespace stageid
