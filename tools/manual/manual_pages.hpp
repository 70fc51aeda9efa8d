#pragma once

#include <string>
#include <vector>

#include "tools/manual/command_tree.hpp"

namespace stageid {

struct ManualPage {
  std::string file;  ///< "stageid-frf.1"
  std::string text;  ///< roff with the man macros
};

/// One page of the program, one of each of its commands; commands of a command (`log info`) stand on its
/// page.
std::vector<ManualPage> manual_pages(const CommandTree& program, const std::string& version);

}  // namespace stageid
