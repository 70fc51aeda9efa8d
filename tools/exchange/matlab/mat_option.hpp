#pragma once

#include <CLI/CLI.hpp>

#include "tools/exchange/matlab/mat_file.hpp"

namespace stageid {

/// Adds --mat-version, for .mat files that the command writes.
void add_mat_version(CLI::App& command, MatVersion& version);

}  // namespace stageid
