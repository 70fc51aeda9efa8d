#include "acquisition/record/log_checks.hpp"

#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"

namespace stageid {

void check_runs(const std::filesystem::path& file, const LogInfo& info,
                const std::vector<LogRun>& runs) {
  const auto period = static_cast<std::uint64_t>(info.period_samples);
  const auto transient = static_cast<std::uint64_t>(info.transient_periods);
  std::map<std::pair<int, int>, std::string> seen;
  for (const LogRun& run : runs) {
    if (!run.complete) continue;
    const std::string place = "/runs/" + run.name;
    if (run.samples % period != 0 || run.samples / period <= transient)
      fail_format(file, place, "has {}; expected {} and at least one further period of {} each",
                  counted(run.samples, "sample"), counted(transient, "transient period"),
                  counted(period, "sample"));
    if (run.realization < 0 || run.experiment < 0)
      fail_format(file, place, "is realization {}, experiment {}; both must be 0 or more",
                  run.realization, run.experiment);
    const auto [other, is_new] = seen.insert({{run.realization, run.experiment}, run.name});
    if (!is_new)
      fail_format(file, place,
                  "duplicate realization {}, experiment {}, also in run {}; keep one of the two",
                  run.realization, run.experiment, other->second);
  }
}

void check_run_index(const std::filesystem::path& file, const std::vector<LogRun>& runs,
                     std::size_t run) {
  if (run < runs.size()) return;
  fail_request("{}: run {} is out of range; the log has {} runs, counted from 0", file.string(),
               run, runs.size());
}

void check_row_range(const std::filesystem::path& file, const LogRun& run, std::uint64_t first,
                     std::uint64_t count) {
  if (first <= run.samples && count <= run.samples - first) return;
  fail_request("{}: {} rows from row {} of run {} are out of range; the run has {} rows",
               file.string(), count, first, run.name, run.samples);
}

void resize_samples(const LogInfo& info, std::uint64_t count, LogSamples& out) {
  const auto rows = static_cast<Eigen::Index>(count);
  out.actuators.resize(rows, info.actuators.size());
  out.sensors.resize(rows, info.sensors.size());
  out.marked.resize(rows);
}

void throw_not_finite(const std::filesystem::path& file, const LogInfo& info, const LogRun& run,
                      std::uint64_t first, const LogSamples& samples, Eigen::Index from,
                      Eigen::Index count) {
  const auto check = [&](Eigen::Index row, const Eigen::MatrixXd& columns, const char* kind,
                         const ChannelList& channels) {
    for (Eigen::Index c = 0; c < columns.cols(); ++c)
      if (!std::isfinite(columns(row, c)))
        fail_format(
            file, "/runs/" + run.name,
            "row {} of {} '{}' is not finite; mark or repair the sample, or exclude the run",
            first + static_cast<std::uint64_t>(row), kind, channels.name(c));
  };
  for (Eigen::Index row = from; row < from + count; ++row) {
    check(row, samples.actuators, "actuator", info.actuators);
    check(row, samples.sensors, "sensor", info.sensors);
  }
  throw std::logic_error("a value that is not finite was seen and not found again");
}

}  // namespace stageid
