#pragma once

#include "excitation/threads/team.hpp"

namespace stageid {

/// What main() does in one process of a team: runs the program and reports its exceptions. @returns the exit code.
int program_main(int argc, char** argv, const Team& team);

}  // namespace stageid
