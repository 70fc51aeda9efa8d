#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_writer.hpp"
#include "tests/support/process/directory_test.hpp"
#include "tests/support/process/file_bytes.hpp"

namespace stageid::test {

// A small log whose values follow from run, row and channel, so that any exchange is detected.

inline constexpr int kPeriod = 12;

inline LogInfo small_info() {
  LogInfo info;
  info.sample_rate_hz = 1000.0;
  info.period_samples = kPeriod;
  info.transient_periods = 1;
  info.excitation = {{"z1", "z2", "z3"}, {"N", "N", "N"}};
  info.actuators = {{"z1", "z2", "z3"}, {"N", "N", "N"}};
  info.sensors = {{"s1", "s2"}, {"m", "m"}};
  info.metadata_json = R"({"seed":7,"text":"größer"})";
  return info;
}

inline double actuator_value(std::size_t run, std::uint64_t row, int channel) {
  return 1000.0 * static_cast<double>(run) + static_cast<double>(row) + 0.125 * (channel + 1);
}

inline double sensor_value(std::size_t run, std::uint64_t row, int channel) {
  return -actuator_value(run, row, channel) * 1e-6;
}

inline bool is_marked(std::size_t run, std::uint64_t row) { return (row + run) % 7 == 3; }

/// Only the column of the run's experiment is nonzero.
inline Eigen::MatrixXd excitation_of(std::size_t run) {
  Eigen::MatrixXd excitation = Eigen::MatrixXd::Zero(kPeriod, 3);
  for (int n = 0; n < kPeriod; ++n)
    excitation(n, static_cast<Eigen::Index>(run % 3)) = 1.0 + n + 10.0 * static_cast<double>(run);
  return excitation;
}

inline std::vector<double> rows_of(std::size_t run, std::uint64_t first, std::uint64_t count) {
  std::vector<double> rows;
  for (std::uint64_t row = first; row < first + count; ++row) {
    for (int c = 0; c < 3; ++c) rows.push_back(actuator_value(run, row, c));
    for (int c = 0; c < 2; ++c) rows.push_back(sensor_value(run, row, c));
    const SampleStatus status{static_cast<std::uint8_t>(row % 3), is_marked(run, row),
                              static_cast<std::uint32_t>(4'000'000'000U - row)};
    rows.push_back(std::bit_cast<double>(pack_status(status)));
  }
  return rows;
}

inline LogRun run_of(std::size_t run, bool complete = true) {
  LogRun made;
  made.realization = static_cast<int>(run / 3);
  made.experiment = static_cast<int>(run % 3);
  made.started_utc = "2024-05-06T07:08:09Z";
  made.complete = complete;
  made.health.cycles = 36;
  made.health.late = 2;
  made.health.missing = 1;
  made.health.marked = 5;
  made.health.largest_lateness_ns = 12345;
  made.health.seconds = 0.25;
  return made;
}

/// One run of `rows` rows in blocks of `block_rows`.
inline void write_run(SlogWriter& log, std::size_t run, std::uint64_t rows = 3 * kPeriod,
                      std::uint64_t block_rows = 10) {
  log.begin_run(run_of(run), excitation_of(run));
  for (std::uint64_t first = 0; first < rows; first += block_rows)
    log.write(rows_of(run, first, std::min(block_rows, rows - first)));
  log.end_run(run_of(run));
}

/// True if rows [first, first + count) are correct, including the marked ones.
inline bool holds_rows(const LogSamples& samples, std::size_t run, std::uint64_t first) {
  for (Eigen::Index r = 0; r < samples.marked.size(); ++r) {
    const std::uint64_t row = first + static_cast<std::uint64_t>(r);
    for (int c = 0; c < 3; ++c) {
      if (samples.actuators(r, c) != actuator_value(run, row, c)) return false;
    }
    for (int c = 0; c < 2; ++c) {
      if (samples.sensors(r, c) != sensor_value(run, row, c)) return false;
    }
    if ((samples.marked[r] != 0) != is_marked(run, row)) return false;
  }
  return true;
}

/// The number of rows in a log of small runs, all of which must be correct.
inline std::uint64_t good_rows(const LogReader& reader) {
  LogSamples samples;
  std::uint64_t rows = 0;
  for (std::size_t run = 0; run < reader.runs().size(); ++run) {
    reader.read(run, 0, reader.runs()[run].samples, samples);
    EXPECT_TRUE(holds_rows(samples, run, 0)) << run;
    rows += reader.runs()[run].samples;
  }
  return rows;
}

inline void write_small_log(const std::filesystem::path& file, std::size_t runs = 2,
                            std::uint64_t block_rows = 10) {
  SlogWriter log = SlogWriter::create(file, small_info());
  for (std::size_t run = 0; run < runs; ++run) write_run(log, run, 3 * kPeriod, block_rows);
  log.close(0, "done");
}

/// A test of a small log in a directory of its own.
struct SmallLogTest : DirectoryTest {
  SlogWriter create() const { return SlogWriter::create(file_, small_info()); }
  SlogWriter resume() const { return SlogWriter::resume(file_, small_info()); }
  /// A closed log with what write(log) writes.
  template <typename Write>
  void create(Write write) const {
    SlogWriter log = create();
    write(log);
    log.close(0, "");
  }

  std::filesystem::path file_ = directory_ / "a.slog";
};

}  // namespace stageid::test
