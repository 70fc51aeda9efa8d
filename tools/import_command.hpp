#pragma once

#include <CLI/CLI.hpp>

namespace stageid {

/// stageid import is announced and not in this version: it says so, and is not in --help.
void add_import_command(CLI::App& app);

}  // namespace stageid
