#pragma once

#include <string>

#include "tools/manual/command_tree.hpp"

namespace stageid {

/// A script for zsh's completion system that completes commands and flags with what they do, and the words that
/// a flag may have; where none fits, file names. It is to stand on $fpath as _NAME.
std::string zsh_completion(const CommandTree& program);

}  // namespace stageid
