#include "acquisition/record/event_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <fstream>

#include "acquisition/files/file_error.hpp"
#include "acquisition/loop/event_recorder.hpp"
#include "hal/stage/stage.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/file_size_limit.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_event_log {

using testing::HasSubstr;

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

struct EventLogTest : testing::Test {
  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_ / "run.events.jsonl";
};

TEST_F(EventLogTest, StandsBesideItsLog) {
  EXPECT_EQ(event_log_of("/a/run.slog"), "/a/run.events.jsonl");
}

TEST_F(EventLogTest, EveryEventIsOneObjectALine) {
  EventLog log(file_);
  log.write("start", {{"runs", std::int64_t{3}}, {"name", std::string("a\n\"b\"")}});
  log.write("end", {{"good", true}, {"seconds", 0.5}});
  const auto lines = lines_of(file_);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_THAT(lines[0], testing::MatchesRegex(
                            R"(\{"time_utc":"[-0-9]+T[:0-9]+\.[0-9]{3}Z","event":"start",.*\})"));
  EXPECT_THAT(lines[0], HasSubstr(R"("runs":3,"name":"a\n\"b\"")"));
  EXPECT_THAT(lines[1], HasSubstr(R"("good":true,"seconds":0.5)"));
  EXPECT_EQ(log.latest(1), (std::vector<std::string>{lines[1]}));
}

TEST_F(EventLogTest, ContinuesWhatIsThere) {
  EventLog(file_).write("start");
  EventLog(file_).write("resume");
  EXPECT_EQ(lines_of(file_).size(), 2U);
}

TEST_F(EventLogTest, AFileThatCannotBeMadeIsAnError) {
  const auto file = directory_ / "no/such.jsonl";
  test::expect_error<FileError>([&] { EventLog{file}; }, file, "");
}

TEST_F(EventLogTest, AFullDiskIsToldAndStopsNothing) {
  EventLog log(file_);
  {
    const test::FileSizeLimit limit(20);
    log.write("start");
    log.write("end");
  }
  EXPECT_THAT(log.error(), HasSubstr("later events are missing"));
  EXPECT_EQ(log.latest(10).size(), 2U);
}

/// Rows of two words: a value and the status.
std::vector<double> rows_of(const std::vector<SampleStatus>& statuses) {
  std::vector<double> rows;
  for (const SampleStatus& status : statuses) {
    rows.push_back(1.0);
    rows.push_back(std::bit_cast<double>(pack_status(status)));
  }
  return rows;
}

constexpr SampleStatus kGood{};
constexpr SampleStatus kStale{static_cast<std::uint8_t>(Outcome::stale), true, 0};
constexpr SampleStatus late(std::uint32_t ns) {
  return {static_cast<std::uint8_t>(Outcome::late), true, ns};
}

TEST_F(EventLogTest, AStretchOfBadCyclesIsOneEventAcrossBlocks) {
  EventLog log(file_);
  EventRecorder recorder(log);
  LogRun run;
  run.realization = 1;
  run.experiment = 4;
  recorder.begin_run(run);
  recorder.rows(rows_of({kGood, kGood, late(5000)}), 2);
  recorder.rows(rows_of({late(9000), kStale, kGood, kStale}), 2);
  run.complete = false;
  recorder.end_run(run);
  const auto lines = lines_of(file_);
  ASSERT_EQ(lines.size(), 5U);
  EXPECT_THAT(lines[0], HasSubstr(R"("event":"run_begin","realization":1,"experiment":4)"));
  EXPECT_THAT(lines[1], HasSubstr(R"("cycle":2,"cycles":2,"outcome":"late","lateness_s":9e-06)"));
  EXPECT_THAT(lines[2], HasSubstr(R"("cycle":4,"cycles":1,"outcome":"stale")"));
  EXPECT_THAT(lines[3], HasSubstr(R"("cycle":6,"cycles":1,"outcome":"stale")"));
  EXPECT_THAT(lines[4], HasSubstr(R"("event":"run_end")"));
  EXPECT_THAT(lines[4], HasSubstr(R"("complete":false)"));
}

TEST_F(EventLogTest, AStageThatFailsAllTheTimeDoesNotFillTheDisk) {
  EventLog log(file_);
  EventRecorder recorder(log);
  recorder.begin_run({});
  for (int i = 0; i < 1000; ++i) recorder.rows(rows_of({kGood, kStale}), 2);
  recorder.end_run({});
  const auto lines = lines_of(file_);
  EXPECT_EQ(lines.size(), EventRecorder::kMissesTold + 2);
  EXPECT_THAT(lines.back(), HasSubstr(R"("misses_not_told":800)"));
}

}  // namespace stageid::test_event_log
