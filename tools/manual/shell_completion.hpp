#pragma once

#include <string>

#include "tools/manual/command_tree.hpp"

namespace stageid {

/// A bash script that completes commands, flags, the words of a flag, and otherwise file names. It needs nothing but
/// bash.
std::string bash_completion(const CommandTree& program);

/// A script for the completion system of zsh that completes commands and flags with descriptions, the words of a flag,
/// and otherwise file names. Install it in $fpath as _NAME.
std::string zsh_completion(const CommandTree& program);

}  // namespace stageid
