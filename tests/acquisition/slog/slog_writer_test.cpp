#include "acquisition/slog/slog_writer.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "acquisition/files/file_error.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/acquisition/record/small_log.hpp"
#include "tests/support/process/file_size_limit.hpp"

namespace stageid::test_slog_writer {

using test::expect_error;

using SlogWriterTest = test::SmallLogTest;

TEST_F(SlogWriterTest, WhatIsWrittenIsReadBack) {
  test::write_small_log(file_, 4, 11);
  const SlogReader reader(file_);

  EXPECT_TRUE(same_measurement(reader.info(), test::small_info()));
  EXPECT_EQ(reader.info().metadata_json, test::small_info().metadata_json);
  ASSERT_EQ(reader.runs().size(), 4U);
  ASSERT_TRUE(reader.end().has_value());
  EXPECT_EQ(reader.end()->exit_code, 0);
  EXPECT_EQ(reader.end()->message, "done");
  EXPECT_EQ(test::good_rows(reader), 4 * 36U);
  for (std::size_t run = 0; run < 4; ++run) {
    const LogRun& read = reader.runs()[run];
    const LogRun written = test::run_of(run);
    EXPECT_EQ(read.name, "000" + std::to_string(run));
    EXPECT_EQ(read.realization, written.realization);
    EXPECT_EQ(read.experiment, written.experiment);
    EXPECT_EQ(read.samples, 36U);
    EXPECT_TRUE(read.complete);
    EXPECT_EQ(read.started_utc, written.started_utc);
    EXPECT_EQ(read.health, written.health);
    EXPECT_EQ(reader.excitation(run), test::excitation_of(run));
  }
}

TEST_F(SlogWriterTest, RowsWithTimeStampsAreReadBackAndResumed) {
  LogInfo info = test::small_info();
  info.stamps = true;
  const auto write = [](SlogWriter log, std::size_t run) {
    const std::vector<double> plain = test::rows_of(run, 0, 3 * test::kPeriod);
    std::vector<double> stamped;
    for (auto row = plain.begin(); row != plain.end(); row += 6) {
      stamped.insert(stamped.end(), row, row + 5);
      // All bits set is not a number as a double, and must not matter.
      stamped.push_back(std::bit_cast<double>(~std::uint64_t{0}));
      stamped.push_back(row[5]);
    }
    log.begin_run(test::run_of(run), test::excitation_of(run));
    log.write(stamped);
    log.end_run(test::run_of(run));
    log.close(0, "");
  };
  write(SlogWriter::create(file_, info), 0);
  // In virtual time, stamps are not requested.
  write(resume(), 1);
  const SlogReader reader(file_);
  EXPECT_TRUE(reader.info().stamps);
  ASSERT_EQ(reader.runs().size(), 2U);
  EXPECT_EQ(test::good_rows(reader), 2 * 36U);
}

TEST_F(SlogWriterTest, ARunWithoutExcitationHasNone) {
  SlogWriter log = create();
  log.begin_run(test::run_of(0), Eigen::MatrixXd::Zero(test::kPeriod, 3));
  log.write(test::rows_of(0, 0, 24));
  log.end_run(test::run_of(0));
  log.close(0, "");
  EXPECT_EQ(SlogReader(file_).excitation(0), Eigen::MatrixXd::Zero(test::kPeriod, 3));
}

TEST_F(SlogWriterTest, RefusesAnExistingFileAndLeavesItAlone) {
  test::write_bytes(file_, "precious");
  expect_error<FileError>([&] { create(); }, file_, "already exists");
  EXPECT_EQ(test::read_bytes(file_), "precious");
  EXPECT_THROW(SlogWriter::create(directory_ / "none/a.slog", test::small_info()), FileError);
  EXPECT_THROW(SlogWriter::resume(directory_ / "none.slog", test::small_info()), FileError);
}

TEST_F(SlogWriterTest, RefusesInfosThatMakeNoSense) {
  const auto refused = [&](auto spoil) {
    LogInfo info = test::small_info();
    spoil(info);
    EXPECT_THROW(SlogWriter::create(file_, info), std::invalid_argument);
    EXPECT_FALSE(std::filesystem::exists(file_));
  };
  refused([](LogInfo& info) { info.sample_rate_hz = 0.0; });
  refused([](LogInfo& info) { info.sample_rate_hz = std::numeric_limits<double>::infinity(); });
  refused([](LogInfo& info) { info.period_samples = 0; });
  refused([](LogInfo& info) { info.transient_periods = -1; });
  refused([](LogInfo& info) { info.sensors.units.pop_back(); });
  refused([](LogInfo& info) { info.actuators.names[1] = "z1"; });
  refused([](LogInfo& info) { info.sensors = {}; });
  refused([](LogInfo& info) { info.metadata_json = "{"; });
  refused([](LogInfo& info) { info.sensors.names[0] = "\xFF"; });
}

TEST_F(SlogWriterTest, RefusesCallsOutOfOrderAndOfWrongSize) {
  SlogWriter log = create();
  const Eigen::MatrixXd excitation = test::excitation_of(0);
  EXPECT_THROW(log.write(test::rows_of(0, 0, 1)), std::invalid_argument);
  EXPECT_THROW(log.end_run(test::run_of(0)), std::invalid_argument);
  EXPECT_THROW(log.begin_run(test::run_of(0), excitation.topRows(5)), std::invalid_argument);
  EXPECT_THROW(log.begin_run(test::run_of(0), excitation.leftCols(2)), std::invalid_argument);
  Eigen::MatrixXd bad = excitation;
  bad(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(log.begin_run(test::run_of(0), bad), std::invalid_argument);
  log.begin_run(test::run_of(0), excitation);
  EXPECT_THROW(log.begin_run(test::run_of(0), excitation), std::invalid_argument);
  const std::vector<double> rows = test::rows_of(0, 0, 2);
  EXPECT_THROW(log.write(std::span(rows).first(7)), std::invalid_argument);
  EXPECT_EQ(log.acknowledged_rows(), 0U);
}

TEST_F(SlogWriterTest, OneWriterAtATime) {
  const SlogWriter log = create();
  expect_error<FileError>([&] { resume(); }, file_, "another process");
}

TEST_F(SlogWriterTest, AFullDiskKeepsWhatWasAcknowledgedAndCanBeResumed) {
  std::uint64_t acknowledged = 0;
  {
    SlogWriter log = create();
    log.begin_run(test::run_of(0), test::excitation_of(0));
    log.write(test::rows_of(0, 0, 10));
    const test::FileSizeLimit limit(log.bytes() + 200);  // room for a part of the next block
    expect_error<FileError>([&] { log.write(test::rows_of(0, 10, 10)); }, file_, "are kept");
    EXPECT_THROW(log.write(test::rows_of(0, 10, 1)), FileError) << "a gap would follow";
    acknowledged = log.acknowledged_rows();
    EXPECT_EQ(std::filesystem::file_size(file_), log.bytes());
  }
  EXPECT_EQ(acknowledged, 10U);
  SlogWriter log = resume();
  EXPECT_FALSE(std::filesystem::exists(directory_ / "a.slog.damaged"));
  test::write_run(log, 0);
  log.close(0, "");
  const SlogReader reader(file_);
  ASSERT_EQ(reader.runs().size(), 2U);
  EXPECT_FALSE(reader.runs()[0].complete);
  EXPECT_EQ(reader.runs()[0].samples, acknowledged);
  EXPECT_TRUE(reader.runs()[1].complete);
}

TEST_F(SlogWriterTest, ResumeAppendsToACleanlyClosedLog) {
  test::write_small_log(file_, 1);
  const std::string before = test::read_bytes(file_);
  {
    SlogWriter log = resume();
    test::write_run(log, 1);
    log.close(3, "later");
  }
  EXPECT_EQ(test::read_bytes(file_).substr(0, before.size()), before) << "append-only";
  const SlogReader reader(file_);
  ASSERT_EQ(reader.runs().size(), 2U);
  EXPECT_EQ(reader.end()->exit_code, 3);
  EXPECT_EQ(test::good_rows(reader), 2 * 36U);
  for (std::size_t run = 0; run < 2; ++run)
    EXPECT_EQ(reader.excitation(run), test::excitation_of(run));
}

TEST_F(SlogWriterTest, ResumeRefusesAnotherExperiment) {
  test::write_small_log(file_, 1);
  const std::string before = test::read_bytes(file_);
  LogInfo other = test::small_info();
  other.period_samples = 24;
  expect_error<FormatError>([&] { SlogWriter::resume(file_, other); }, file_,
                            "a different experiment");
  other = test::small_info();
  other.sensors.names[0] = "s9";
  EXPECT_THROW(SlogWriter::resume(file_, other), FormatError);
  test::write_bytes(directory_ / "text", "no log at all");
  EXPECT_THROW(SlogWriter::resume(directory_ / "text", other), FormatError);
  other = test::small_info();
  other.metadata_json = R"({"started":"another time"})";
  EXPECT_NO_THROW(SlogWriter::resume(file_, other));
  EXPECT_EQ(test::read_bytes(file_), before) << "nothing was written yet";
}

TEST_F(SlogWriterTest, ResumeMovesADamagedTailAside) {
  for (const char* saved : {"a.slog.damaged", "a.slog.damaged.2"}) {
    std::filesystem::remove(file_);
    std::uint64_t intact = 0;
    {
      SlogWriter log = create();
      log.begin_run(test::run_of(0), test::excitation_of(0));
      log.write(test::rows_of(0, 0, 20));
      intact = log.bytes();
      log.write(test::rows_of(0, 20, 10));
    }
    const std::string whole = test::read_bytes(file_);
    test::write_bytes(file_, whole.substr(0, whole.size() - 100));
    SlogWriter log = resume();
    EXPECT_EQ(log.bytes(), intact);
    EXPECT_EQ(test::read_bytes(directory_ / saved),
              whole.substr(intact, whole.size() - 100 - intact));
    test::write_run(log, 0);
    log.close(0, "");
    const SlogReader reader(file_);
    EXPECT_EQ(reader.runs()[0].samples, 20U);
    EXPECT_FALSE(reader.runs()[0].complete);
    EXPECT_TRUE(reader.runs()[1].complete);
  }
}

TEST_F(SlogWriterTest, ResumeDoesNotThrowIntactBlocksAway) {
  test::write_small_log(file_, 2);
  std::string bytes = test::read_bytes(file_);
  bytes[bytes.size() / 2] ^= 1;
  test::write_bytes(file_, bytes);
  expect_error<FormatError>([&] { resume(); }, file_, "recover");
  EXPECT_EQ(test::read_bytes(file_), bytes);
}

}  // namespace stageid::test_slog_writer
