#include "tools/fleet/fleet_pairing.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "acquisition/files/file_error.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/fleet/fleet_fixture.hpp"

namespace stageid {
namespace {

using test::identification;

std::string date_of(int day) { return fmt::format("2026-01-{:02}T06:00:00Z", day + 1); }

/// Stages that differ by 0.3 %, with modes that scatter by 0.01 % from day to day.
std::vector<Identification> small_fleet(int stages) {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> normal;
  std::vector<Identification> out;
  for (int stage = 0; stage < stages; ++stage) {
    const double factor = 1.0 + 3e-3 * normal(engine);
    for (int day = 0; day < 20; ++day) {
      std::vector<double> hz = {100.0 * factor, 150.0 * factor, 152.0 * factor};
      for (double& value : hz) value *= 1.0 + 1e-4 * normal(engine);
      out.push_back(identification(fmt::format("{} {}", stage, day), fmt::format("stage {}", stage),
                                   date_of(day), hz));
    }
  }
  return out;
}

struct FleetPairingTest : testing::Test {
  FleetStore store_of(const std::string& name, const std::vector<Identification>& all) const {
    const std::filesystem::path place = test::store_place(folder_, name);
    FleetStore store(place, DatabaseAccess::create);
    for (const Identification& one : all) store.add(one);
    return {place, DatabaseAccess::write};
  }
  static std::vector<std::string> rows(const FleetStore& store, const std::string& sql) {
    std::vector<std::string> out;
    const auto statement = store.database().prepare(sql);
    while (statement->step()) {
      out.emplace_back();
      for (int c = 0; c < statement->columns(); ++c) out.back() += statement->text(c) + "|";
    }
    return out;
  }
  test::TemporaryDirectory folder_;
};

constexpr const char* kAllModes =
    "SELECT stage, time_utc, mode, frequency_hz, deviation FROM modes ORDER BY 1, 2, 4";

TEST_F(FleetPairingTest, NumbersTheSameModesOnAllStagesByFrequency) {
  FleetStore store = store_of("a.db", small_fleet(6));
  pair_fleet(store);
  EXPECT_EQ(rows(store, "SELECT mode, COUNT(*), COUNT(DISTINCT stage) FROM modes GROUP BY mode"),
            (std::vector<std::string>{"1|120|6|", "2|120|6|", "3|120|6|"}));
  EXPECT_EQ(
      rows(store, "SELECT mode FROM modes WHERE ABS(frequency_hz / 100 - 1) < 0.05 AND mode <> 1")
          .size(),
      0U);
  EXPECT_EQ(rows(store, "SELECT * FROM outliers").size(), 0U);
}

TEST_F(FleetPairingTest, DoesNotDependOnTheOrderOfArrival) {
  std::vector<Identification> all = small_fleet(3);
  FleetStore ordered = store_of("a.db", all);
  pair_fleet(ordered);
  std::ranges::shuffle(all, std::mt19937_64(2));
  const std::vector<Identification> first(all.begin(), all.begin() + 25);
  FleetStore shuffled = store_of("b.db", first);
  pair_fleet(shuffled);
  for (const Identification& one : all) shuffled.add(one);
  pair_fleet(shuffled);
  EXPECT_EQ(rows(shuffled, kAllModes), rows(ordered, kAllModes));
}

TEST_F(FleetPairingTest, NamesTheReasonOfAnOutlier) {
  std::vector<Identification> all = small_fleet(1);
  all[10].modes[0].frequency_hz *= 1.01;
  all[15].modes.erase(all[15].modes.begin() + 1);
  FleetStore store = store_of("a.db", all);
  pair_fleet(store);
  const std::vector<std::string> found =
      rows(store, "SELECT time_utc, outlier FROM outliers ORDER BY time_utc");
  ASSERT_EQ(found.size(), 2U);
  EXPECT_TRUE(found[0].starts_with(date_of(10))) << found[0];
  EXPECT_NE(found[0].find("standard deviations from the past"), std::string::npos) << found[0];
  EXPECT_TRUE(found[1].starts_with(date_of(15))) << found[1];
  EXPECT_NE(found[1].find("the mode is missing"), std::string::npos) << found[1];
}

TEST_F(FleetPairingTest, MarksAModeUnlikeThatOfOtherStages) {
  std::vector<Identification> all = small_fleet(9);
  for (Identification& one : all)
    if (one.stage == "stage 4") one.modes[0].frequency_hz *= 1.03;
  FleetStore store = store_of("a.db", all);
  pair_fleet(store);
  EXPECT_EQ(rows(store, "SELECT stage, mode FROM stage_modes WHERE ABS(deviation) > 4"),
            std::vector<std::string>{"stage 4|1|"});
}

TEST_F(FleetPairingTest, GivesRareModesNoNumber) {
  std::vector<Identification> all = small_fleet(2);
  all[3].modes.push_back(identification("x", "s", "", {77.0}).modes[0]);
  FleetStore store = store_of("a.db", all);
  pair_fleet(store);
  EXPECT_EQ(rows(store, "SELECT CAST(frequency_hz AS INTEGER) FROM modes WHERE mode IS NULL"),
            std::vector<std::string>{"77|"});
}

TEST_F(FleetPairingTest, EndsOnADamagedStore) {
  if (!test::stores_are_files()) GTEST_SKIP() << "PostgreSQL keeps the types of columns";
  FleetStore store = store_of("a.db", small_fleet(2));
  store.database().execute(
      "UPDATE mode SET frequency_std_hz = 9e999, shape = X'0000C07F00' WHERE number = 2");
  EXPECT_NO_THROW(pair_fleet(store));
  store.database().execute("UPDATE mode SET frequency_hz = -1; UPDATE stage SET changed = 1");
  EXPECT_THROW(pair_fleet(store), FormatError);
}

TEST_F(FleetPairingTest, CompletesAnInterruptedPairing) {
  FleetStore store = store_of("a.db", small_fleet(2));
  pair_fleet(store);
  const std::vector<std::string> whole = rows(store, kAllModes);
  store.database().execute("UPDATE track SET mode = NULL; UPDATE stage SET changed = 2");
  pair_fleet(store);
  EXPECT_EQ(rows(store, kAllModes), whole);
}

}  // namespace
}  // namespace stageid
