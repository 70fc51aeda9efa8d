#pragma once

namespace stageid {

/// The whole program but for catching. @returns the exit code.
/// @throws everything that a command may throw.
int run_program(int argc, const char* const* argv);

}  // namespace stageid
