#pragma once

#include <string>

#include "tools/manual/command_tree.hpp"

namespace stageid {

/// A script for bash that completes commands, flags and the words that a flag may have; where none fits,
/// file names. It needs nothing but bash.
std::string bash_completion(const CommandTree& program);

}  // namespace stageid
