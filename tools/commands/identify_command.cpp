#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>

#include "tools/commands/command_line.hpp"
#include "tools/commands/identification.hpp"
#include "tools/experiment/loop_check.hpp"

namespace stageid {
namespace {

/// stageid identify CONFIG -o DIR
class IdentifyCommand {
 public:
  IdentifyCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path config_;
  std::filesystem::path output_;
  bool resume_ = false;
  bool force_ = false;
  int threads_ = 0;
};

IdentifyCommand::IdentifyCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "identify",
                                  "Perform the complete identification: design, run, frf, modes, "
                                  "fit, validate, export, report");
  command->add_option("config", config_, "experiment file (.yaml)")->required();
  command->add_option("-o,--output", output_, "directory for all results")->required();
  command->add_flag("--resume", resume_,
                    "continue an interrupted identification; steps that are up to date are kept");
  command->add_flag(
      "--force", force_,
      "measure even if the design predicts that a limit is exceeded; limits still stop the run");
  add_threads(*command, threads_);
  command->final_callback([this] { run(); });
}

void IdentifyCommand::run() const {
  const ExperimentConfig config = load_experiment_config(config_);
  if (!resume_ && std::filesystem::exists(output_ / "run.slog"))
    throw std::invalid_argument(
        fmt::format("{}: already contains a run; continue it with --resume, or choose another "
                    "directory with -o",
                    output_.string()));
  require_stable_loop(config, console_);
  Identification identification(config, {output_, resume_, force_, threads_}, console_);
  console_.exit_code = identification.run();
}

}  // namespace

std::shared_ptr<void> identify_command(CLI::App& app, Console& console) {
  return std::make_shared<IdentifyCommand>(app, console);
}

}  // namespace stageid
