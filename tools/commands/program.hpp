#pragma once

#include "excitation/threads/team.hpp"

namespace stageid {

/// The whole program except the handlers of exceptions, in one process of a team. @returns the exit code.
/// @throws any exception of a command.
int run_program(int argc, const char* const* argv, const Team& team = Team::one());

}  // namespace stageid
