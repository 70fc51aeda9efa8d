#include "tools/fleet/watched_tracks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_matrices.hpp"
#include "tests/support/process/directory_test.hpp"
#include "tests/tools/fleet/fleet_fixture.hpp"

namespace stageid::test_watched_tracks {

using testing::HasSubstr;
using testing::ThrowsMessage;

struct WatchedTracksTest : test::DirectoryTest {
  /// Half an hour of learning, then a value each half hour; the changes grow by 1e-4 each time.
  void write_tracks(int periods, const std::string& kind = "frequency",
                    const std::string& started_utc = "2026-03-04T23:00:00Z") const {
    Hdf5File file = Hdf5File::create(tracks_);
    file.write_attribute("/", "format", std::string("stageid-watch"));
    file.write_attribute("/", "started_utc", started_utc);
    file.write_texts("/names", {"frequency of the mode at 100 Hz", "delay"});
    file.write_texts("/kinds", {kind, "delay"});
    write_vector(file, "/nominal", std::vector<double>{100.0, 0.0});
    const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(periods, 1.0, periods);
    write_vector(file, "/time_s", Eigen::VectorXd(1800.0 * t));
    Eigen::VectorXd learning = Eigen::VectorXd::Zero(periods);
    learning[0] = 1.0;
    write_vector(file, "/learning", learning);
    Eigen::MatrixXd change(periods, 2);
    change << 1e-4 * t, 1e-7 * t;
    write_matrix(file, "/change", change);
    write_matrix(file, "/deviation", Eigen::MatrixXd::Constant(periods, 2, 1e-5));
    file.close();
  }

  std::filesystem::path tracks_ = directory_ / "watch.h5";
  FleetStore store_{test::store_place(directory_), DatabaseAccess::create};
};

TEST_F(WatchedTracksTest, StoresTheValuesAtTheEndOfEachHour) {
  write_tracks(
      4);  // ends at 00:30, 01:00 (learned from: 23:30), ... after 2 h: 01:00 of the next day
  EXPECT_EQ(add_watched(store_, {tracks_, "A", ""}), 4U);
  const auto rows = store_.database().prepare(
      "SELECT stage, time_utc, property, kind, value, change, deviation FROM watched "
      "ORDER BY kind DESC, time_utc");
  const std::vector<std::pair<std::string, int>> expected = {{"2026-03-05T00:30:00Z", 3},
                                                             {"2026-03-05T01:00:00Z", 4}};
  for (const auto& [time, t] : expected) {
    ASSERT_TRUE(rows->step());
    EXPECT_EQ(rows->text(0), "A");
    EXPECT_EQ(rows->text(1), time);
    EXPECT_EQ(rows->text(2), "frequency of the mode at 100 Hz");
    EXPECT_EQ(rows->text(3), "frequency");
    EXPECT_DOUBLE_EQ(rows->number(4), 100.0 * (1.0 + 1e-4 * t));
    EXPECT_DOUBLE_EQ(rows->number(5), 1e-4 * t);
    EXPECT_DOUBLE_EQ(rows->number(6), 1e-5);
  }
  for (const auto& [time, t] : expected) {
    ASSERT_TRUE(rows->step());
    EXPECT_EQ(rows->text(1), time);
    EXPECT_DOUBLE_EQ(rows->number(4), 1e-7 * t);
  }
  EXPECT_FALSE(rows->step());
}

TEST_F(WatchedTracksTest, ALogThatHasGrownReplacesItsValues) {
  write_tracks(4);
  add_watched(store_, {tracks_, "A", ""});
  write_tracks(6);
  EXPECT_EQ(add_watched(store_, {tracks_, "A", ""}), 6U);
  add_watched(store_, {tracks_, "B", "2026-01-01"});
  const auto rows_of = [&](const std::string& stage) {
    const auto rows = store_.database().prepare("SELECT COUNT(*) FROM watched WHERE stage = ?");
    rows->bind(stage).step();
    return rows->integer(0);
  };
  // The last value of the shorter log is at the end of an hour that both have.
  EXPECT_EQ(rows_of("A"), 8);
  EXPECT_EQ(rows_of("B"), 6);
}

TEST_F(WatchedTracksTest, RefusesOtherFilesAndStoresNothing) {
  write_tracks(4, "frequency", "");
  EXPECT_THAT(
      [&] {
        add_watched(store_, {tracks_, "A", ""});
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("--time")));
  write_tracks(4, "colour");
  EXPECT_THAT(
      [&] {
        add_watched(store_, {tracks_, "A", ""});
      },
      ThrowsMessage<FormatError>(HasSubstr("unknown kind 'colour'")));
  Hdf5File::create(tracks_).close();
  EXPECT_THAT(
      [&] {
        add_watched(store_, {tracks_, "A", ""});
      },
      ThrowsMessage<FormatError>(HasSubstr("contains no tracks")));
  EXPECT_FALSE(store_.database().prepare("SELECT 1 FROM stage")->step());
}

}  // namespace stageid::test_watched_tracks
