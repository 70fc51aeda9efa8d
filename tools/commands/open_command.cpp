#include <chrono>
#include <cstdio>
#include <thread>

#include "acquisition/files/fail.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/commands/commands.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/output_paths.hpp"
#include "tools/workbench/workbench.hpp"

namespace stageid {
namespace {

/// stageid open DIR|FILE...
void open_workbench(const WorkbenchOptions& flags, Console& console) {
  if (!flags.write && !flags.directory.empty())
    fail_request("--output: the workbench is read-only; add --write");
  if (!flags.directory.empty()) require_directory(flags.directory);
  Workbench workbench(flags);
  const CleanedUpAtInterrupt tells_the_pages([&workbench] { workbench.end(); });
  say_at_interrupt("saved models are kept");
  console.result("workbench: {}", workbench.url());
  console.result({{"url", workbench.url()}});
  std::fflush(stdout);  // programs that wait for the page read this line
  console.message("open this address in a browser; SIGINT or SIGTERM ends it");
  while (true) std::this_thread::sleep_for(std::chrono::hours(1));  // a signal ends the program
}

}  // namespace

void open_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "open",
                  "Edit a fit in the browser: modes, band and options, until SIGINT or SIGTERM",
                  open_workbench);
  add_required(command, "inputs", flags.inputs,
               "output directory of 'stageid identify', or files as of 'stageid report', with "
               "an FRF");
  command.add_option("--compare", flags.compare,
                     "results to compare with, each an output directory of 'stageid identify', an "
                     "FRF or a model");
  command.add_flag("--write", flags.write, "permit to save models; default: read-only");
  command.add_option("-o,--output", flags.directory,
                     "directory for saved models; default: that of the FRF");
  command.add_option("--controller-view", flags.stage,
                     "stage file (.yaml): show the loop of each fit with its controller");
  add_setting(command, "--port", flags.port, "INT",
              "port on this machine, which others cannot reach; 0: any free one",
              CLI::Range(0, 65535));
  add_threads(command, flags.threads);
}

}  // namespace stageid
