#pragma once

namespace stageid {

/// The whole program except the handlers of exceptions. @returns the exit code.
/// @throws any exception of a command.
int run_program(int argc, const char* const* argv);

}  // namespace stageid
