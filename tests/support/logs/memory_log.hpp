#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/record/log_reader.hpp"

namespace stageid::test {

/// prefix1, prefix2, ...
inline ChannelList channels(const std::string& prefix, Eigen::Index count,
                            const std::string& unit) {
  ChannelList list;
  for (Eigen::Index i = 1; i <= count; ++i) {
    list.names.push_back(prefix + std::to_string(i));
    list.units.push_back(unit);
  }
  return list;
}

/// A log that lives in memory. Everything is public: tests spoil it on purpose.
struct MemoryLog : LogReader {
  std::filesystem::path file = "memory.slog";
  LogInfo log_info;
  std::vector<LogRun> log_runs;
  std::vector<Eigen::MatrixXd> excitation_periods;  ///< period_samples x axes, one per run
  std::vector<LogSamples> records;                  ///< whole runs

  const std::filesystem::path& path() const noexcept override { return file; }
  const LogInfo& info() const noexcept override { return log_info; }
  const std::vector<LogRun>& runs() const noexcept override { return log_runs; }
  Eigen::MatrixXd excitation(std::size_t run) const override { return excitation_periods.at(run); }

  void read(std::size_t run, std::uint64_t first, std::uint64_t count,
            LogSamples& out) const override {
    const LogSamples& record = records.at(run);
    const auto begin = static_cast<Eigen::Index>(first);
    const auto rows = static_cast<Eigen::Index>(count);
    if (begin + rows > record.sensors.rows()) throw std::out_of_range("memory log: past the end");
    out.actuators = record.actuators.middleRows(begin, rows);
    out.sensors = record.sensors.middleRows(begin, rows);
    out.marked = record.marked.segment(begin, rows);
  }

  void append(int realization, int experiment, Eigen::MatrixXd excitation_period,
              LogSamples record) {
    LogRun run;
    run.name = std::to_string(10000 + log_runs.size()).substr(1);
    run.realization = realization;
    run.experiment = experiment;
    run.samples = static_cast<std::uint64_t>(record.sensors.rows());
    if (record.marked.size() == 0) record.marked.setZero(record.sensors.rows());
    log_runs.push_back(std::move(run));
    excitation_periods.push_back(std::move(excitation_period));
    records.push_back(std::move(record));
  }
};

}  // namespace stageid::test
