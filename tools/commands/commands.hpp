#pragma once

#include <CLI/CLI.hpp>
#include <vector>

#include "tools/terminal/console.hpp"

namespace stageid {

struct WatchOptions;

/// Each adds one command to the program; parsing a command line that contains it runs it.
void identify_command(CLI::App& app, Console& console);
void design_command(CLI::App& app, Console& console);
void run_command(CLI::App& app, Console& console);
void log_command(CLI::App& app, Console& console);
void frf_command(CLI::App& app, Console& console);
void modes_command(CLI::App& app, Console& console);
void fit_command(CLI::App& app, Console& console);
void validate_command(CLI::App& app, Console& console);
void watch_command(CLI::App& app, Console& console);
void export_command(CLI::App& app, Console& console);
void import_command(CLI::App& app, Console& console);
void fleet_command(CLI::App& app, Console& console);
void report_command(CLI::App& app, Console& console);
void open_command(CLI::App& app, Console& console);
void plot_command(CLI::App& app, Console& console);
void config_command(CLI::App& app, Console& console);
void node_command(CLI::App& app, Console& console);
void manual_command(CLI::App& app, Console& console);
void help_command(CLI::App& app, Console& console);

/// Adds the options of a watch except its model. @returns them
std::vector<CLI::Option*> add_watch_options(CLI::App& command, WatchOptions& options);

}  // namespace stageid
