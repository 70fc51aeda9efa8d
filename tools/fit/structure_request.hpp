#pragma once

#include <string>

#include "tools/fit/fit_request.hpp"

namespace stageid {

/// What a request asks for where it is silent: submodels that are asked for stand alone, without them
/// modes are searched beside a rigid body.
std::string requested_modes(const FitRequest& request);       ///< auto | none | ...
std::string requested_rigid_body(const FitRequest& request);  ///< full | none | ...

/// Fills FitSetup::structure and the ranks of its options.
/// @pre setup.frf, options.hold are final
/// @throws std::invalid_argument naming the flag
void choose_structure(const FitRequest& request, FitSetup& setup);

/// Above, the sampled response cannot tell a mode from its alias.
/// @throws std::invalid_argument naming the flag
void require_below_nyquist(const char* flag, const FitSetup& setup, double frequency_hz);

}  // namespace stageid
