#include "tools/fleet/fleet_page.hpp"

#include <gtest/gtest.h>

#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/fleet/fleet_fixture.hpp"
#include "tools/fleet/fleet_pairing.hpp"

namespace stageid {
namespace {

using test::identification;

struct FleetPageTest : testing::Test {
  std::string page() {
    pair_fleet(store_);
    return fleet_page(store_, {{}, "", "", folder_ / "fleet.html"});
  }
  test::TemporaryDirectory folder_;
  FleetStore store_{test::store_place(folder_), DatabaseAccess::create};
};

TEST_F(FleetPageTest, OmitsStagesWithoutIdentifications) {
  // A failed job that the table had not named, and its repair.
  Identification failed = identification("a", "folder of the log", "2026-01-01", {});
  failed.verdict = IdentificationVerdict::failed;
  store_.add(failed);
  EXPECT_NE(page().find("folder of the log"), std::string::npos);
  store_.add(identification("a", "left stage", "2026-01-01", {100.0}));
  EXPECT_NE(page().find("left stage"), std::string::npos);
  EXPECT_EQ(page().find("folder of the log"), std::string::npos);
}

TEST_F(FleetPageTest, ShowsADamagedStore) {
  if (!test::stores_are_files()) GTEST_SKIP() << "PostgreSQL keeps the types of columns";
  store_.add(identification("a", "s", "2026-01-01", {100.0}));
  pair_fleet(store_);
  store_.database().execute("UPDATE track SET damping_ratio = 1e-310, frequency_std_hz = 9e999");
  EXPECT_NO_THROW(page());
}

TEST_F(FleetPageTest, IsSafeForNamesWithMarkup) {
  store_.add(identification("a", "</script><script>alert(1)", "2026-01-01", {100.0}));
  EXPECT_EQ(page().find("<script>alert"), std::string::npos);
}

}  // namespace
}  // namespace stageid
