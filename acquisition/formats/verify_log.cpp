#include <algorithm>
#include <memory>

#include "acquisition/files/file_error.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_recover.hpp"

namespace stageid {

namespace {

constexpr std::uint64_t kVerifiedRows = 16384;

/// Reads all rows; unreadable rows are damage.
void check_values(const LogReader& reader, VerifyReport& report) {
  LogSamples samples;
  for (std::size_t run = 0; run < reader.runs().size(); ++run) {
    const std::uint64_t rows = reader.runs()[run].samples;
    try {
      if (reader.runs()[run].complete) static_cast<void>(reader.excitation(run));
      for (std::uint64_t first = 0; first < rows; first += kVerifiedRows) {
        const std::uint64_t count = std::min(kVerifiedRows, rows - first);
        reader.read(run, first, count, samples);
        report.rows += count;
        report.marked_rows += static_cast<std::uint64_t>((samples.marked != 0).count());
      }
    } catch (const FormatError& error) {
      report.damage.push_back({0, 0, error.what()});
    }
  }
}

void count_runs(const LogReader& reader, VerifyReport& report) {
  const std::vector<LogRun>& runs = reader.runs();
  report.runs = static_cast<int>(runs.size());
  report.complete_runs = static_cast<int>(
      std::count_if(runs.begin(), runs.end(), [](const LogRun& run) { return run.complete; }));
}

}  // namespace

VerifyReport verify_log(const std::filesystem::path& file) {
  VerifyReport report;
  report.closed = true;
  std::unique_ptr<LogReader> reader = open_log(file, false);
  report.bytes = std::filesystem::file_size(file);
  if (dynamic_cast<const SlogReader*>(reader.get()) != nullptr) {
    auto native = std::make_unique<SlogReader>(file, false, SlogScanDepth::payloads);
    report.blocks = native->intact_blocks();
    report.damage = native->damage();
    report.closed = native->end().has_value();
    report.exit_code = report.closed ? native->end()->exit_code : 0;
    report.exit_message = report.closed ? native->end()->message : "";
    reader = std::move(native);
  }
  count_runs(*reader, report);
  check_values(*reader, report);
  return report;
}

}  // namespace stageid
