#include "frf/runs/run_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"

namespace stageid {
namespace {

using RunsByExperiment = std::map<int, UsedRun>;
using RunsByRealization = std::map<int, RunsByExperiment>;

void check_log(const LogReader& log) {
  const LogInfo& info = log.info();
  if (!(info.sample_rate_hz > 0.0) || !std::isfinite(info.sample_rate_hz)) {
    throw FormatError(log.path(), "/", "sample_rate_hz must be positive and finite");
  }
  if (info.period_samples < 4)
    fail_format(log.path(), "/", "period_samples is {}; must be at least 4", info.period_samples);
}

void check_same_setup(const LogReader& first, const LogReader& other) {
  const LogInfo& a = first.info();
  const LogInfo& b = other.info();
  const char* differs = nullptr;
  if (a.sample_rate_hz != b.sample_rate_hz) differs = "sample rate";
  if (a.period_samples != b.period_samples) differs = "period";
  if (!(a.excitation == b.excitation)) differs = "excitation channels";
  if (!(a.actuators == b.actuators)) differs = "actuator channels";
  if (!(a.sensors == b.sensors)) differs = "sensor channels";
  if (differs != nullptr)
    fail_request("{}: different {} than in {}; logs that are used together must have the same",
                 other.path().string(), differs, first.path().string());
}

UsedRun measured_part(const LogReader& log, std::size_t index, const FrfOptions& options) {
  const LogInfo& info = log.info();
  UsedRun used{&log, index, transient_periods(info, options), 0};
  const std::string place = fmt::format("/runs/{}", used.run().name);
  const auto period = static_cast<std::uint64_t>(info.period_samples);
  const std::uint64_t samples = used.run().samples;
  if (samples == 0 || samples % period != 0)
    fail_format(
        log.path(), place,
        "{} are not a whole number of periods of {}; correct period_samples or trim the record",
        counted(samples, "sample"), counted(period, "sample"));
  used.periods = static_cast<int>(samples / period) - used.transient_periods;
  if (used.periods < 1)
    fail_format(log.path(), place,
                "{} recorded, {} transient: no period remains. Measure longer or "
                "lower transient_periods",
                counted(samples / period, "period"), used.transient_periods);
  return used;
}

RunsByRealization complete_runs(const std::vector<const LogReader*>& logs,
                                const FrfOptions& options) {
  const auto wanted = [&options](int realization) {
    const std::vector<int>& list = options.realizations;
    return list.empty() || std::ranges::find(list, realization) != list.end();
  };
  RunsByRealization table;
  for (const LogReader* log : logs) {
    for (std::size_t i = 0; i < log->runs().size(); ++i) {
      const LogRun& run = log->runs()[i];
      if (!run.complete || !wanted(run.realization)) continue;
      table[run.realization].insert_or_assign(run.experiment, measured_part(*log, i, options));
    }
  }
  return table;
}

/// Every experiment, or realization, that was begun.
std::set<int> begun(const std::vector<const LogReader*>& logs, int LogRun::*which) {
  std::set<int> found;
  for (const LogReader* log : logs) {
    for (const LogRun& run : log->runs()) found.insert(run.*which);
  }
  return found;
}

std::string why_incomplete(const RunsByExperiment& runs, const std::set<int>& experiments,
                           const std::string& log) {
  std::vector<int> missing;
  for (const int experiment : experiments)
    if (!runs.contains(experiment)) missing.push_back(experiment + 1);
  return fmt::format("{}: no complete run of experiment {} (counted from 1)", log,
                     fmt::join(missing, ", "));
}

void check_realizations_asked_for(const RunsByRealization& table, const FrfOptions& options,
                                  const std::vector<const LogReader*>& logs) {
  std::set<int> complete;
  for (const LogReader* reader : logs)
    for (const LogRun& run : reader->runs())
      if (run.complete) complete.insert(run.realization + 1);
  const std::string log = logs.front()->path().string();
  for (const int realization : options.realizations) {
    if (!table.contains(realization))
      fail_request("{}: realization {} has no complete run; those with one are {} (counted from 1)",
                   log, realization + 1, fmt::join(complete, ", "));
  }
}

/// Number of experiments that a realization must have to be used by default.
///
/// By default, all that were begun: missing experiments would silently exclude inputs. If the inputs are named, the
/// number of the most complete realization suffices.
std::size_t needed_experiments(const RunsByRealization& table, std::size_t begun,
                               const FrfOptions& options, const std::string& log) {
  const auto best = std::ranges::max_element(
      table, {}, [](const auto& realization) { return realization.second.size(); });
  const std::size_t most = best->second.size();
  if (most < begun && options.inputs.empty())
    fail_request(
        "{}: no realization is complete; realization {} (counted from 1) has {} of {}. "
        "Resume the experiment, or name the inputs",
        log, best->first + 1, most, counted(begun, "experiment"));
  return most;
}

}  // namespace

int transient_periods(const LogInfo& info, const FrfOptions& options) {
  return options.transient_periods.value_or(
      options.method == FrfMethod::lpm ? 0 : info.transient_periods);
}

std::string UsedRun::place() const {
  return fmt::format("{}:/runs/{}", log->path().string(), run().name);
}

ChosenRuns choose_runs(const std::vector<const LogReader*>& logs, const FrfOptions& options) {
  if (logs.empty()) throw std::invalid_argument("no log given; give at least one");
  if (options.transient_periods.value_or(0) < 0) {
    throw std::invalid_argument("transient_periods: must be 0 or more");
  }
  for (const LogReader* log : logs) {
    check_log(*log);
    check_same_setup(*logs.front(), *log);
  }
  const RunsByRealization table = complete_runs(logs, options);
  const std::string first = logs.front()->path().string();
  check_realizations_asked_for(table, options, logs);
  if (table.empty())
    fail_request("{}: no complete run; measure at least one realization to its end", first);
  const std::set<int> experiments = begun(logs, &LogRun::experiment);
  const std::size_t needed = needed_experiments(table, experiments.size(), options, first);

  ChosenRuns chosen;
  for (const auto& [realization, runs] : table) {
    if (options.realizations.empty() && runs.size() < needed) continue;
    RealizationRuns entry{realization, {}};
    for (const auto& [experiment, used] : runs) entry.runs.push_back(used);
    chosen.realizations.push_back(std::move(entry));
  }
  if (!options.realizations.empty()) return chosen;
  for (const int realization : begun(logs, &LogRun::realization)) {
    const auto at = table.find(realization);
    const RunsByExperiment runs = at == table.end() ? RunsByExperiment{} : at->second;
    if (runs.size() < needed)
      chosen.incomplete.push_back({realization, why_incomplete(runs, experiments, first)});
  }
  return chosen;
}

}  // namespace stageid
