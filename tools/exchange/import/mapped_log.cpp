#include "tools/exchange/import/mapped_log.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/formats/convert_log.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "tools/exchange/import/foreign_formats.hpp"
#include "tools/exchange/import/import_signals.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

LogInfo info_of(const ArrayList& arrays, const ImportMap& map, const SignalGroup& excitation,
                const SignalGroup& actuators, const SignalGroup& sensors) {
  LogInfo info;
  info.sample_rate_hz = sample_rate_of(arrays, map);
  info.period_samples = static_cast<int>(map.period_samples);
  info.transient_periods = static_cast<int>(map.transient_periods);
  info.excitation = excitation.channels;
  info.actuators = actuators.channels;
  info.sensors = sensors.channels;
  try {
    check_log_info(info);
  } catch (const std::invalid_argument& error) {
    refuse_map(map, "{}", error.what());
  }
  return info;
}

/// A log that is written atomically.
class LogImport {
 public:
  LogImport(const ImportMap& map, const std::filesystem::path& output)
      : map_(map), scratch_(output) {
    std::filesystem::remove(scratch_.path());  // logs are never overwritten
  }

  void add(const ArrayList& arrays, const ImportedRun& run) {
    const auto read = [&](const char* key, const ImportMap::Signals& group) {
      return read_signals(arrays, map_, key, group, run.place, notes_);
    };
    const SignalGroup excitation = read("excitation", map_.excitation);
    const SignalGroup actuators = read("actuators", map_.actuators);
    const SignalGroup sensors = read("sensors", map_.sensors);
    if (actuators.samples.rows() != sensors.samples.rows())
      refuse_map(map_, "actuators have {} samples, sensors {}; the numbers must be equal",
                 actuators.samples.rows(), sensors.samples.rows());
    const LogInfo info = info_of(arrays, map_, excitation, actuators, sensors);
    const RunRows rows = rows_of(arrays, map_, run.run, actuators.samples.rows());
    const Eigen::MatrixXd period = period_of(arrays, map_, excitation, rows);
    open(arrays, info);
    require_another(run.run);
    write(run.run, rows, period, actuators, sensors);
  }

  ImportSummary close(const std::filesystem::path& output) {
    require_full();
    writer_->close(0, "imported");
    if (output.extension() == ".slog")
      scratch_.commit();
    else
      convert_log(*open_log(scratch_.path()), output);
    return summary_.summary(writer_->info(), notes_);
  }

 private:
  void open(const ArrayList& arrays, const LogInfo& info) {
    if (!writer_) {
      map_.sample_rate_hz = info.sample_rate_hz;  // those of the following files must agree
      writer_.emplace(SlogWriter::create(scratch_.path(), info));
      return;
    }
    if (!same_measurement(info, writer_->info()))
      arrays.fail("",
                  "has {} excitation, {} actuator and {} sensor channels at {} "
                  "Hz; the previous runs differ. Import this file separately",
                  info.excitation.size(), info.actuators.size(), info.sensors.size(),
                  info.sample_rate_hz);
  }

  void require_another(const ImportMap::Run& run) {
    if (!runs_.emplace(run.realization, run.experiment).second)
      refuse_map(map_,
                 "duplicate run: realization {}, experiment {} (counted from 1); separate "
                 "the runs with the key runs, an axis or the pattern of the names",
                 run.realization + 1, run.experiment + 1);
  }

  /// A realization that lacks one of its experiments is unusable, so report a missing run here.
  void require_full() {
    std::set<std::int64_t> realizations, experiments;
    for (const auto& [realization, experiment] : runs_) {
      realizations.insert(realization);
      experiments.insert(experiment);
    }
    std::vector<std::string> missing;
    for (const std::int64_t m : realizations)
      for (const std::int64_t e : experiments)
        if (!runs_.contains({m, e}))
          missing.push_back(fmt::format("realization {}, experiment {}", m + 1, e + 1));
    if (missing.empty()) return;
    constexpr std::size_t kMost = 3;
    const std::size_t count = missing.size();
    if (count > kMost) missing.resize(kMost);
    notes_.push_back(
        fmt::format("missing: {}{} (counted from 1); 'frf' skips incomplete realizations",
                    fmt::join(missing, "; "), count > kMost ? "; ..." : ""));
  }

  void write(const ImportMap::Run& from, const RunRows& rows, const Eigen::MatrixXd& period,
             const SignalGroup& actuators, const SignalGroup& sensors) {
    constexpr Eigen::Index kPieceRows = 4096;
    LogRun run;
    run.realization = static_cast<int>(from.realization);
    run.experiment = static_cast<int>(from.experiment);
    run.health.cycles = static_cast<std::uint64_t>(rows.count);
    writer_->begin_run(run, period);
    for (Eigen::Index at = 0; at < rows.count; at += kPieceRows) {
      const Eigen::Index count = std::min(kPieceRows, rows.count - at);
      write_samples(*writer_, {actuators.samples.middleRows(rows.first + at, count),
                               sensors.samples.middleRows(rows.first + at, count),
                               {}});
    }
    run.samples = static_cast<std::uint64_t>(rows.count);
    writer_->end_run(run);
    summary_.add(run, period, actuators.samples.middleRows(rows.first, rows.count),
                 sensors.samples.middleRows(rows.first, rows.count));
  }

  ImportMap map_;
  OutputFile scratch_;
  std::optional<SlogWriter> writer_;
  std::set<std::pair<std::int64_t, std::int64_t>> runs_;
  std::vector<std::string> notes_;
  LogSummary summary_;
};

}  // namespace

ImportSummary import_mapped_log(const std::vector<ForeignFile>& files, const ImportMap& map,
                                const std::filesystem::path& output) {
  require_ending(output, "a log", {".slog", ".h5", ".hdf5"});
  LogImport log(map, output);
  for (const ForeignFile& file : files) {
    const ArrayList arrays = read_foreign_arrays(file.path);
    for (const ImportedRun& run : runs_of(arrays, map, files, file)) log.add(arrays, run);
  }
  return log.close(output);
}

}  // namespace stageid
