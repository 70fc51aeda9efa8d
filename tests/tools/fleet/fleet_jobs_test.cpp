#include "tools/fleet/fleet_jobs.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "acquisition/files/file_error.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/fleet/fleet_fixture.hpp"
#include "tools/fleet/fleet_time.hpp"

namespace stageid {
namespace {

struct FleetJobsTest : testing::Test {
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  FleetConfig config(const std::string& text) const {
    return load_fleet_config(write("fleet.yaml", "format: stageid-fleet\n" + text));
  }
  std::string problem(const std::string& text) const {
    try {
      fleet_logs(config(text), Console());
    } catch (const std::exception& error) {
      return std::string(error.what()).substr((folder_ / "").string().size());
    }
    return "";
  }
  test::TemporaryDirectory folder_;
};

TEST_F(FleetJobsTest, FindsLogsByPatternAndTable) {
  for (const char* name : {"b.slog", "a.slog", "c.h5"}) write(name, name);
  write("logs.csv",
        "log,stage,time_utc,temperature\nb.slog,left,2026-01-02,21.5\nd.slog,right,,\n");
  const std::vector<FleetLog> logs =
      fleet_logs(config("logs: ['*.slog']\ntable: logs.csv\n"), Console());
  ASSERT_EQ(logs.size(), 3U);
  EXPECT_EQ(logs[0].file.filename(), "a.slog");
  EXPECT_EQ(logs[0].stage, "");
  EXPECT_EQ(logs[1].file.filename(), "b.slog");
  EXPECT_EQ(logs[1].stage, "left") << "the table wins";
  EXPECT_EQ(logs[1].tags,
            (std::vector<std::pair<std::string, std::string>>{{"temperature", "21.5"}}));
  EXPECT_EQ(logs[2].file.filename(), "d.slog");
  EXPECT_TRUE(logs[2].tags.empty()) << "an empty field is not a tag";
}

TEST_F(FleetJobsTest, FindsLogsInAFolderWhoseNameLooksLikeAPattern) {
  std::filesystem::create_directory(folder_ / "[a]*");
  write("[a]*/x.slog", "x");
  const std::filesystem::path file =
      write("[a]*/fleet.yaml", "format: stageid-fleet\nlogs: ['*.slog', '../[[]a]*/x.slog']\n");
  const std::vector<FleetLog> logs = fleet_logs(load_fleet_config(file), Console());
  ASSERT_EQ(logs.size(), 1U);
  EXPECT_EQ(logs[0].file, folder_ / "[a]*" / "x.slog");
}

TEST_F(FleetJobsTest, WarnsOfAPatternWithoutALog) {
  write("a.slog", "a");
  const FleetConfig given = config("logs: ['*.slog', missing.slog]\n");
  testing::internal::CaptureStderr();
  EXPECT_EQ(fleet_logs(given, Console()).size(), 1U);
  const std::string warning = testing::internal::GetCapturedStderr();
  EXPECT_NE(warning.find("fleet.yaml: logs: no file matches '"), std::string::npos) << warning;
  EXPECT_NE(warning.find("missing.slog'"), std::string::npos) << warning;
}

TEST_F(FleetJobsTest, NamesTheProblemAndItsPlace) {
  EXPECT_EQ(problem("").substr(0, 14), "fleet.yaml:1:9");
  EXPECT_EQ(problem("logs: [x]\nlosg: [x]\n").substr(0, 14), "fleet.yaml:3:1");
  EXPECT_EQ(problem("logs: [x]\nidentification: {fit: {method: no}}\n").substr(0, 12),
            "fleet.yaml:3");
  write("logs.csv", "log,stage\n\n,left\n");
  EXPECT_EQ(problem("table: logs.csv\n"),
            "logs.csv:3: the field 'log' is empty; name a log, or remove the line");
  write("logs.csv", "log,stage\nx\n");
  EXPECT_EQ(problem("table: logs.csv\n"), "logs.csv:2: got 1 fields; the header has 2");
}

TEST_F(FleetJobsTest, IdentifiesAJobByLogAndOptions) {
  const std::string id = job_id("f", config("logs: [x]\nidentification: {fit: {modes: 4}}\n"));
  EXPECT_EQ(job_id("f", config("logs: [y]  # other logs, a comment\nstore: z.db\nidentification:\n"
                               "  fit:\n    modes: 4\n")),
            id);
  EXPECT_NE(job_id("g", config("logs: [x]\nidentification: {fit: {modes: 4}}\n")), id);
  EXPECT_NE(job_id("f", config("logs: [x]\nidentification: {fit: {modes: 5}}\n")), id);
}

TEST_F(FleetJobsTest, FingerprintsAChangedLogAgain) {
  FleetStore store(test::store_place(folder_), DatabaseAccess::create);
  const std::filesystem::path log = write("a.slog", "one");
  const std::string before = log_fingerprint(store, log);
  EXPECT_EQ(log_fingerprint(store, log), before);
  write("a.slog", "three");
  EXPECT_NE(log_fingerprint(store, log), before);
  EXPECT_THROW(log_fingerprint(store, folder_ / "missing"), FileError);
}

TEST(FleetTime, ReadsDatesInUtc) {
  EXPECT_EQ(days_of("1970-01-02"), 1.0);
  EXPECT_EQ(days_of("1970-01-02T12:00:00Z"), 1.5);
  EXPECT_EQ(days_of("2026-02-30"), std::nullopt);
  EXPECT_EQ(days_of("1970-01-02T12:00:00.000"), 1.5);
  EXPECT_EQ(days_of("yesterday"), std::nullopt);
}

TEST(FleetTime, RefusesTimesThatWouldBeReadOrSortedWrongly) {
  for (const char* text : {"2026-5-4", "2026-05-04 12:34:56", "2026-05-04T12:34:56+02:00",
                           "2026-05-04T24:00:00Z", "2026-05-04T12:34Z", "2026-05-04T12:34:nan",
                           "99999-01-01", "2026-05-04 and more", "+026-05-04"})
    EXPECT_EQ(days_of(text), std::nullopt) << text;
}

}  // namespace
}  // namespace stageid
