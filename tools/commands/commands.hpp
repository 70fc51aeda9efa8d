#pragma once

#include <CLI/CLI.hpp>
#include <memory>

#include "tools/terminal/console.hpp"

namespace stageid {

/// Each adds one command to the program; parsing a command line that contains it runs it. The result owns what the
/// command has read from its line and must live as long as `app`.
std::shared_ptr<void> identify_command(CLI::App& app, Console& console);
std::shared_ptr<void> design_command(CLI::App& app, Console& console);
std::shared_ptr<void> run_command(CLI::App& app, Console& console);
std::shared_ptr<void> log_command(CLI::App& app, Console& console);
std::shared_ptr<void> frf_command(CLI::App& app, Console& console);
std::shared_ptr<void> modes_command(CLI::App& app, Console& console);
std::shared_ptr<void> fit_command(CLI::App& app, Console& console);
std::shared_ptr<void> validate_command(CLI::App& app, Console& console);
std::shared_ptr<void> export_command(CLI::App& app, Console& console);
std::shared_ptr<void> import_command(CLI::App& app, Console& console);
std::shared_ptr<void> report_command(CLI::App& app, Console& console);
std::shared_ptr<void> plot_command(CLI::App& app, Console& console);
std::shared_ptr<void> config_command(CLI::App& app, Console& console);
std::shared_ptr<void> node_command(CLI::App& app, Console& console);
std::shared_ptr<void> manual_command(CLI::App& app, Console& console);
std::shared_ptr<void> help_command(CLI::App& app, Console& console);

}  // namespace stageid
