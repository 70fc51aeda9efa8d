#include "acquisition/formats/convert_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <fstream>
#include <sstream>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_recover.hpp"
#include "tests/acquisition/record/small_log.hpp"
#include "tests/support/process/directory_test.hpp"

namespace stageid::test_convert_log {

/// Two complete runs and an incomplete one.
std::unique_ptr<LogReader> write_log(const std::filesystem::path& file) {
  SlogWriter log = SlogWriter::create(file, test::small_info());
  test::write_run(log, 0);
  test::write_run(log, 1);
  log.begin_run(test::run_of(2), test::excitation_of(2));
  log.write(test::rows_of(2, 0, 5));
  log.end_run(test::run_of(2, false));
  log.close(130, "interrupted");
  return open_log(file);
}

using ConvertLog = test::DirectoryTest;

TEST_F(ConvertLog, HDF5HoldsTheSame) {
  const auto native = write_log(directory_ / "a.slog");
  std::uint64_t done = 0;
  convert_log(*native, directory_ / "a.h5",
              {.progress = [&](std::uint64_t rows, std::uint64_t total) {
                EXPECT_EQ(total, 77U);
                done = rows;
              }});
  EXPECT_EQ(done, 77U);
  const auto hdf5 = open_log(directory_ / "a.h5");
  EXPECT_TRUE(same_measurement(hdf5->info(), native->info()));
  EXPECT_EQ(hdf5->info().metadata_json, test::small_info().metadata_json);
  ASSERT_EQ(hdf5->runs().size(), 3U);
  EXPECT_EQ(test::good_rows(*hdf5), 77U);
  for (std::size_t run = 0; run < 3; ++run) {
    const LogRun& read = hdf5->runs()[run];
    EXPECT_EQ(read.complete, run != 2);
    EXPECT_EQ(read.realization, native->runs()[run].realization);
    EXPECT_EQ(read.experiment, native->runs()[run].experiment);
    EXPECT_EQ(read.started_utc, native->runs()[run].started_utc);
    EXPECT_EQ(hdf5->excitation(run), test::excitation_of(run));
  }
  EXPECT_TRUE(verify_log(directory_ / "a.h5").intact());
  EXPECT_EQ(verify_log(directory_ / "a.h5").rows, 77U);
  convert_log(*hdf5, directory_ / "b.h5");
  EXPECT_EQ(test::good_rows(*open_log(directory_ / "b.h5")), 77U);
  const Hdf5File file = Hdf5File::open(directory_ / "a.h5");
  EXPECT_EQ(file.read_integer_attribute("/runs/0001", "marked_samples"), 5);
}

TEST_F(ConvertLog, AMarkOfTimingStaysOneOfTiming) {
  SlogWriter log = SlogWriter::create(directory_ / "a.slog", test::small_info());
  log.begin_run(test::run_of(0), test::excitation_of(0));
  std::vector<double> rows = test::rows_of(0, 0, 36);
  const std::size_t words = rows.size() / 36;
  const auto put = [&](std::size_t row, const SampleStatus& status) {
    rows[row * words + words - 1] = std::bit_cast<double>(pack_status(status));
  };
  put(3, {.marked = true, .irregular = true});
  put(4, {.outcome = 1, .marked = true, .irregular = true});
  put(5, {});
  log.write(rows);
  LogRun run = test::run_of(0);
  run.health.irregular = 1;
  log.end_run(run);
  log.close(3, "");
  convert_log(*open_log(directory_ / "a.slog"), directory_ / "a.h5");
  for (const char* name : {"b.slog", "b.h5"})
    convert_log(*open_log(directory_ / "a.h5"), directory_ / name);
  for (const char* name : {"a.slog", "a.h5", "b.slog", "b.h5"}) {
    SCOPED_TRACE(name);
    LogSamples samples;
    open_log(directory_ / name)->read(0, 3, 3, samples);
    EXPECT_THAT(std::vector<int>(samples.marked.begin(), samples.marked.end()),
                testing::ElementsAre(kIrregularMark, kBadMark, 0));
  }
  const Hdf5File file = Hdf5File::open(directory_ / "a.h5");
  EXPECT_EQ(file.read_integer_attribute("/runs/0000", "irregular_samples"), 1);
}

TEST_F(ConvertLog, RunsThatWereBrokenOffCanBeLeftOut) {
  convert_log(*write_log(directory_ / "a.slog"), directory_ / "a.h5", {.incomplete_runs = false});
  EXPECT_EQ(open_log(directory_ / "a.h5")->runs().size(), 2U);
}

TEST_F(ConvertLog, CsvReadsBackToTheSameNumbers) {
  convert_log(*write_log(directory_ / "a.slog"), directory_ / "a.csv");
  std::ifstream in(directory_ / "a.csv");
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line,
            "run,realization,experiment,time_s,marked,\"excitation z1 [N]\",\"excitation z2 [N]\","
            "\"excitation z3 [N]\",\"actuator z1 [N]\",\"actuator z2 [N]\",\"actuator z3 [N]\","
            "\"sensor s1 [m]\",\"sensor s2 [m]\"");
  std::size_t lines = 0;
  for (std::size_t run = 0; run < 3; ++run) {
    const Eigen::MatrixXd excitation = test::excitation_of(run);
    for (std::uint64_t row = 0; row < (run == 2 ? 5U : 36U); ++row) {
      ASSERT_TRUE(std::getline(in, line));
      ++lines;
      std::istringstream cells(line);
      std::vector<double> values;
      for (std::string cell; std::getline(cells, cell, ',');) values.push_back(std::stod(cell));
      ASSERT_EQ(values.size(), 13U);
      EXPECT_EQ(values[0], static_cast<double>(run));
      EXPECT_EQ(values[2], static_cast<double>(run % 3));
      EXPECT_EQ(values[3], static_cast<double>(row) / 1000.0);
      EXPECT_EQ(values[4], test::is_marked(run, row) ? 1.0 : 0.0);
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(values[5 + c], excitation(static_cast<Eigen::Index>(row % test::kPeriod), c));
        EXPECT_EQ(values[8 + c], test::actuator_value(run, row, c));
      }
      EXPECT_EQ(values[12], test::sensor_value(run, row, 1));
    }
  }
  EXPECT_FALSE(std::getline(in, line)) << "nothing more";
  EXPECT_EQ(lines, 77U);
}

TEST_F(ConvertLog, LeavesNothingHalfWritten) {
  const auto reader = write_log(directory_ / "a.slog");
  EXPECT_THROW(convert_log(*reader, directory_ / "a.txt"), std::invalid_argument);
  EXPECT_THROW(convert_log(*reader, directory_ / "none/a.h5"), FileError);
  // The log is damaged after it was opened, so that the conversion fails.
  std::string bytes = test::read_bytes(directory_ / "a.slog");
  bytes[bytes.size() * 3 / 4] ^= 1;
  test::write_bytes(directory_ / "a.slog", bytes);
  EXPECT_THROW(convert_log(*reader, directory_ / "a.h5"), FormatError);
  EXPECT_THROW(convert_log(*reader, directory_ / "a.csv"), FormatError);
  const std::filesystem::directory_iterator files(directory_.path());
  EXPECT_EQ(std::distance(files, {}), 1) << "the log alone";
}

}  // namespace stageid::test_convert_log
