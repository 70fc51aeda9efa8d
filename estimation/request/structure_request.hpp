#pragma once

#include <string>

#include "estimation/request/fit_request.hpp"

namespace stageid {

/// The kind of modes with defaults resolved: requested submodels replace modes and rigid body.
ModesRequest::Kind modes_kind(const FitRequest& request) noexcept;
RigidBodyRequest::Kind rigid_body_kind(const FitRequest& request) noexcept;

/// As in YAML and on the command line: "full", "2", "suspension:0.4:0.5".
std::string rigid_body_text(const FitRequest& request);

/// Fills FitSetup::structure and the ranks of its options.
/// @pre setup.frf, options.hold are final; request.direct_term and general_damping are set
/// @throws std::invalid_argument naming the request's member
void choose_structure(const FitRequest& request, FitSetup& setup);

/// Above half the sample rate, a mode cannot be distinguished from its alias.
/// @throws std::invalid_argument naming the request's member
void require_below_nyquist(const char* member, const FitSetup& setup, double frequency_hz);

}  // namespace stageid
