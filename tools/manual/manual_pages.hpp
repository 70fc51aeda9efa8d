#pragma once

#include <string>
#include <vector>

#include "tools/manual/command_tree.hpp"

namespace stageid {

struct ManualPage {
  std::string file;  ///< "stageid-frf.1"
  std::string text;  ///< roff with the man macros
};

/// One page for the program and one per command; subcommands (`log info`) are on the page of their command.
std::vector<ManualPage> manual_pages(const CommandTree& program, const std::string& version);

}  // namespace stageid
