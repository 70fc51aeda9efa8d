#include "tools/commands/commands.hpp"

#include <filesystem>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/report/report_input.hpp"
#include "tools/report/report_verdict.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// stageid report DIR|FILE... -o report.html
struct ReportFlags {
  std::vector<std::filesystem::path> inputs;
  std::vector<std::filesystem::path> compare;
  std::filesystem::path output;
};

void report(const ReportFlags& flags, Console& console) {
  std::vector<std::filesystem::path> read = flags.inputs;
  read.insert(read.end(), flags.compare.begin(), flags.compare.end());
  require_writable(flags.output, read);
  const std::string ending = flags.output.extension().string();
  if (ending != ".html" && ending != ".htm")
    fail_request(
        "{}: the report is an HTML page; use a name ending in .html. To print it, use a browser",
        flags.output.string());
  ReportData data = read_report_data(report_input(flags.inputs));
  if (!flags.compare.empty()) add_comparison(data, flags.compare);
  write_report(flags.output, data);
  console.result("wrote {}", flags.output.string());
  const Verdict verdict = judge(data);
  console.result({{"output", flags.output.string()}, {"verdict", verdict_json(verdict)}});
  if (verdict.level != Verdict::Level::bad) return;
  console.exit_code = kNotTrustworthy;
  warn_of(verdict.problems, flags.output, console);
}

}  // namespace

void report_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "report", "Write a self-contained interactive HTML page", report);
  add_required(command, "inputs", flags.inputs,
               "output directory of 'stageid identify', or files: FRF, held-back FRF, model, "
               "modes, log, controller view, stage file (channel positions)");
  command.add_option("--compare", flags.compare,
                     "results to compare with: another output directory of 'stageid identify', or "
                     "its FRF and model");
  add_required(command, "-o,--output", flags.output, "page to write (.html)");
}

}  // namespace stageid
