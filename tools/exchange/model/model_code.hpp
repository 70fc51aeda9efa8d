#pragma once

#include <string>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// The sampled state space with its delays as a header for C99 and C++17: constants, a state, a reset and a step. It allocates nothing
/// and includes no other header. Numbers read back to the same double.
///   NAME_reset(&state);   NAME_step(&state, u, y);   // y[n] of u[n], the sums of sampled_state_space.hpp in order
/// @param name of the types and functions, a C identifier
/// @throws std::invalid_argument as sampled_state_space(), and if a delay is negative
std::string model_code(const AdditiveModel& model, const std::string& name);

}  // namespace stageid
