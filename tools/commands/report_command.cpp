#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "tools/commands/command_line.hpp"
#include "tools/report/report_input.hpp"
#include "tools/report/report_verdict.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// stageid report DIR|FILE... -o report.html
class ReportCommand {
 public:
  ReportCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::vector<std::filesystem::path> inputs_;
  std::vector<std::filesystem::path> compare_;
  std::filesystem::path output_;
};

ReportCommand::ReportCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "report", "Write a self-contained interactive HTML page");
  command
      ->add_option("inputs", inputs_,
                   "output directory of 'stageid identify', or files: FRF, held-back FRF, model, "
                   "modes, log, stage file (channel positions)")
      ->required();
  command->add_option("--compare", compare_,
                      "results to compare with: another output directory of 'stageid identify', or "
                      "its FRF and model");
  command->add_option("-o,--output", output_, "page to write (.html)")->required();
  command->final_callback([this] { run(); });
}

void ReportCommand::run() const {
  std::vector<std::filesystem::path> read = inputs_;
  read.insert(read.end(), compare_.begin(), compare_.end());
  require_writable(output_, read);
  const std::string ending = output_.extension().string();
  if (ending != ".html" && ending != ".htm")
    throw std::invalid_argument(fmt::format(
        "{}: the report is an HTML page; use a name ending in .html. To print it, use a browser",
        output_.string()));
  ReportData data = read_report_data(report_input(inputs_));
  if (!compare_.empty()) add_comparison(data, compare_);
  write_report(output_, data);
  console_.result(fmt::format("wrote {}", output_.string()));
  const Verdict verdict = judge(data);
  console_.result({{"output", output_.string()},
                   {"verdict",
                    {{"level", to_string(verdict.level)},
                     {"text", verdict.text},
                     {"reasons", verdict.reasons}}}});
  if (verdict.level != Verdict::Level::bad) return;
  console_.exit_code = kNotTrustworthy;
  console_.warning(
      fmt::format("{}: not to be trusted: {}", output_.string(), fmt::join(verdict.reasons, "; ")));
}

}  // namespace

std::shared_ptr<void> report_command(CLI::App& app, Console& console) {
  return std::make_shared<ReportCommand>(app, console);
}

}  // namespace stageid
