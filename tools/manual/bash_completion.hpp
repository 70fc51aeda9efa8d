#pragma once

#include <string>

#include "tools/manual/command_tree.hpp"

namespace stageid {

/// A bash script that completes commands, flags, the words of a flag, and otherwise file names. It needs nothing but
/// bash.
std::string bash_completion(const CommandTree& program);

}  // namespace stageid
