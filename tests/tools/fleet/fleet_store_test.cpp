#include "tools/fleet/fleet_store.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "acquisition/files/file_error.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/fleet/fleet_fixture.hpp"

namespace stageid {
namespace {

using test::count_in;
using test::identification;
using namespace std::chrono_literals;
using States = std::map<std::string, JobState>;

struct FleetStoreTest : testing::Test {
  FleetStore open() const { return {test::store_place(folder_), DatabaseAccess::create}; }
  test::TemporaryDirectory folder_;
};

TEST_F(FleetStoreTest, StoresAJobOnce) {
  FleetStore store = open();
  EXPECT_TRUE(store.add(identification("a", "s", "2026-01-01", {100.0, 200.0})));
  EXPECT_FALSE(store.add(identification("a", "s", "2026-01-01", {100.0, 200.0})));
  EXPECT_EQ(count_in(store, "identification"), 1);
  EXPECT_EQ(count_in(store, "mode"), 2);
  EXPECT_EQ(store.jobs(), (States{{"a", JobState::current}}));
}

TEST_F(FleetStoreTest, ReplacesAFailedJobOfTheSameLog) {
  FleetStore store = open();
  Identification failed = identification("a", "folder", "2026-01-01", {});
  failed.verdict = IdentificationVerdict::failed;
  failed.log = "/data/x.slog";
  EXPECT_TRUE(store.add(failed));
  EXPECT_EQ(store.state_of("a"), JobState::failed);
  EXPECT_EQ(store.state_of("b"), JobState::none);
  EXPECT_TRUE(store.failure("a").has_value());
  EXPECT_FALSE(store.failure("b").has_value());
  EXPECT_TRUE(store.add(failed)) << "it failed again";
  EXPECT_EQ(count_in(store, "identification"), 1);
  // The log was repaired: another fingerprint, so another job.
  Identification repaired = identification("b", "s", "2026-01-01", {100.0});
  repaired.log = failed.log;
  EXPECT_TRUE(store.add(repaired));
  EXPECT_EQ(count_in(store, "identification"), 1);
  EXPECT_EQ(count_in(store, "tag"), 1);
}

TEST_F(FleetStoreTest, ShowsTheNewestResultOfALogAndKeepsTheOthers) {
  FleetStore store = open();
  Identification one = identification("a", "s", "2026-01-01", {100.0});
  one.log_fingerprint = "log";
  store.add(one);
  one.job = "b";
  one.configuration = "other options";
  store.add(one);
  EXPECT_EQ(store.jobs(), (States{{"a", JobState::superseded}, {"b", JobState::current}}));
  EXPECT_EQ(count_in(store, "modes"), 1);
  EXPECT_EQ(count_in(store, "mode"), 2);
  store.make_current("a");
  EXPECT_EQ(store.jobs(), (States{{"a", JobState::current}, {"b", JobState::superseded}}));
}

TEST_F(FleetStoreTest, KeepsWhatWasStored) {
  Identification given = identification("a", "s", "2026-01-01T06:00:00Z", {123.456});
  given.modes[0].frequency_std_hz = std::nullopt;
  given.tags = {{"temperature", "21.5"}, {"site", "north"}};
  open().add(given);
  const FleetStore store(test::store_place(folder_), DatabaseAccess::read);
  const auto mode = store.database().prepare(
      "SELECT frequency_hz, frequency_std_hz, shape, damping_ratio_std FROM mode");
  ASSERT_TRUE(mode->step());
  EXPECT_EQ(mode->number(0), 123.456);
  EXPECT_TRUE(mode->is_null(1));
  const Eigen::VectorXcd shape = residue_shape(mode->bytes(2), 2);
  const Eigen::MatrixXcd residue =
      given.modes[0].output_shape * given.modes[0].input_shape.transpose();
  EXPECT_LT((shape - residue.reshaped()).norm(), 1e-6);
  const auto tags = store.database().prepare("SELECT name, number, text FROM tag ORDER BY name");
  ASSERT_TRUE(tags->step());
  EXPECT_EQ(tags->text(2), "north");
  EXPECT_TRUE(tags->is_null(1));
  ASSERT_TRUE(tags->step());
  EXPECT_EQ(tags->number(1), 21.5);
}

TEST_F(FleetStoreTest, ShowsBytesAsHexadecimalDigits) {
  FleetStore store = open();
  store.add(identification("a", "s", "2026-01-01", {100.0}));
  const auto row = store.database().prepare("SELECT shape, 'text' FROM mode; -- a comment");
  ASSERT_TRUE(row->step());
  EXPECT_EQ(row->text(0).substr(0, 16), "0000803f00000000");  // float32 1 + 0j
  EXPECT_EQ(row->text(0).size(), 2U * row->bytes(0).size());
  EXPECT_EQ(row->text(1), "text");
}

TEST_F(FleetStoreTest, ReadersCannotWrite) {
  open();
  const FleetStore store(test::store_place(folder_), DatabaseAccess::read);
  EXPECT_THROW(store.database().execute("DELETE FROM stage"), std::exception);
}

TEST_F(FleetStoreTest, TakesAnyBytesAsTheNameOfALog) {
  FleetStore store = open();
  Identification odd = identification("a", "s", "2026-01-01", {100.0});
  odd.log = "/data/\xff\xfe'\"?.slog";
  EXPECT_TRUE(store.add(odd));
  EXPECT_EQ(count_in(store, "identification WHERE log LIKE '%?.slog'"), 1);
}

TEST_F(FleetStoreTest, AStatementThatFailsIsToldAtTheEndAndNothingIsStored) {
  const FleetStore store = open();
  for (const int more : {0, 500}) {  // statements behind it
    EXPECT_THROW(
        {
          Transaction transaction(store.database());
          const auto add =
              store.database().prepare("INSERT INTO stage (name, changed) VALUES (?, 0)");
          add->run(std::string("twice"));
          add->run(std::string("twice"));
          for (int i = 0; i < more; ++i) add->run(fmt::format("{}", i));
          transaction.commit();
        },
        std::invalid_argument);
    EXPECT_EQ(count_in(store, "stage"), 0);
  }
}

TEST_F(FleetStoreTest, AJobIsClaimedByOneOfSeveral) {
  const FleetStore one = open();
  EXPECT_TRUE(one.database().claim(7));
  {
    const FleetStore other = open();
    EXPECT_FALSE(other.database().claim(7));
    EXPECT_TRUE(other.database().claim(8));
    one.database().release(7);
    EXPECT_TRUE(other.database().claim(7));
  }
  bool claimed = false;  // a server needs a moment to see the end
  for (int i = 0; i < 500 && !claimed; ++i, std::this_thread::sleep_for(10ms))
    claimed = one.database().claim(7);
  EXPECT_TRUE(claimed) << "claims end with their owner";
}

TEST_F(FleetStoreTest, RefusesASecondStatement) {
  const FleetStore store = open();
  EXPECT_THROW(store.database().prepare("SELECT 1; DELETE FROM stage"), std::invalid_argument);
  EXPECT_THROW(store.database().prepare("SELECT 1; SELEC"), std::invalid_argument);
}

TEST_F(FleetStoreTest, HasEveryJobOnceWithTwoWriters) {
  open();
  const auto write = [&] {
    FleetStore store = open();
    for (int i = 0; i < 200; ++i)
      store.add(identification(std::to_string(i), std::to_string(i % 7), "2026-01-01", {100.0}));
  };
  std::thread other(write);
  write();
  other.join();
  FleetStore store = open();
  EXPECT_EQ(count_in(store, "identification"), 200);
  EXPECT_EQ(count_in(store, "mode"), 200);
  EXPECT_EQ(count_in(store, "stage"), 7);
  EXPECT_EQ(count_in(store, "channels"), 1);
}

TEST_F(FleetStoreTest, StoresAllOfAJobOrNothingOnAFullDisk) {
  if (!test::stores_are_files()) GTEST_SKIP() << "by a limit of SQLite";
  FleetStore store = open();
  store.database().execute("PRAGMA max_page_count = 40");  // SQLITE_FULL, as from a full disk
  const std::vector<double> modes(50, 100.0);
  int stored = 0;
  try {
    for (;; ++stored)
      store.add(
          identification(std::to_string(stored), fmt::format("s{}", stored), "2026-01-01", modes));
  } catch (const FileError& error) {
    EXPECT_NE(std::string(error.what()).find("fleet.db: No space left on device"),
              std::string::npos)
        << error.what();
  }
  EXPECT_GT(stored, 0);
  EXPECT_EQ(count_in(store, "identification"), stored);
  EXPECT_EQ(count_in(store, "stage"), stored);
  EXPECT_EQ(count_in(store, "mode"), 50 * stored);
  // With space again, the same object goes on.
  store.database().execute("PRAGMA max_page_count = 4000");
  EXPECT_TRUE(store.add(
      identification(std::to_string(stored), fmt::format("s{}", stored), "2026-01-01", modes)));
  EXPECT_EQ(count_in(store, "stage"), stored + 1);
}

TEST_F(FleetStoreTest, RefusesOtherFiles) {
  const std::filesystem::path text = folder_ / "text.db";
  std::ofstream(text) << "not a database, but a text that is long enough to have a header\n";
  EXPECT_THROW(FleetStore(text, DatabaseAccess::create), FormatError);
  EXPECT_THROW(FleetStore(folder_ / "missing.db", DatabaseAccess::read), FileError);
  const std::filesystem::path foreign = folder_ / "foreign.db";
  open_database(foreign, DatabaseAccess::create)->execute("CREATE TABLE x (y INTEGER)");
  EXPECT_THROW(FleetStore(foreign, DatabaseAccess::create), FormatError);
}

TEST_F(FleetStoreTest, RefusesAnotherVersionOfTheSchema) {
  open().database().execute("UPDATE store SET schema_version = 99");
  EXPECT_THROW(open(), FormatError);
}

TEST_F(FleetStoreTest, ForgetsTheFingerprintOfAChangedLog) {
  FleetStore store = open();
  store.note_log("/x", 10, 5, "f");
  EXPECT_EQ(store.log_fingerprint("/x", 10, 5), "f");
  EXPECT_EQ(store.log_fingerprint("/x", 10, 6), std::nullopt);
  EXPECT_EQ(store.log_fingerprint("/x", 11, 5), std::nullopt);
  store.note_log("/x", 10, 6, "g");
  EXPECT_EQ(store.log_fingerprint("/x", 10, 6), "g");
}

}  // namespace
}  // namespace stageid
