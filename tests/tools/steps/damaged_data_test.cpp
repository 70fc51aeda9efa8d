// Damaged or unexpected logs, with the real program. What is damaged by itself is in
// tests/integration/messages_cases.py.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/support/logs/hdf5_surgery.hpp"
#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_damaged_data {

struct DamagedData : ProgramTest {
  void make_hdf5_log() const {
    make_log();
    succeed("log convert run.slog -o log.h5");
  }
};

TEST_F(DamagedData, RecoverSavesWhatIsLeft) {
  make_log();
  const std::string whole = read_bytes(at("run.slog"));
  write_bytes(at("cut.slog"), whole.substr(0, whole.size() * 2 / 3));
  const ProgramResult recover = succeed("log recover cut.slog -o saved.slog --json");
  EXPECT_THAT(recover.out, testing::HasSubstr("\"complete_runs\": 5"));
  fail("log recover cut.slog -o saved.slog", 2, "already exists");
  EXPECT_THAT(succeed("log verify saved.slog").out, testing::HasSubstr("intact"));
  succeed("frf saved.slog -o f.h5 --realizations 1");
}

TEST_F(DamagedData, AnExcitationThatIsNotFinite) {
  make_hdf5_log();
  Hdf5Surgery(at("log.h5"))
      .poke("/runs/0002/excitation", 5, std::numeric_limits<double>::quiet_NaN());
  fail("frf log.h5 -o f.h5", 2, "0002");
}

TEST_F(DamagedData, AnAxisThatIsNeverExcitedIsRefusedOrLeftOut) {
  make_hdf5_log();
  for (int m = 0; m < 3; ++m) {  // the second of three experiments repeats the first
    const std::string second = fmt::format("/runs/{:04}", 3 * m + 1);
    Hdf5Surgery log(at("log.h5"));
    log.remove(second);
    log.copy(fmt::format("/runs/{:04}", 3 * m), second);
    log.set_attribute(second, "experiment", 1);
  }
  fail("frf log.h5 -o f.h5 --inputs a1,a2,a3", 2, "3 inputs but only 2 excited axes (a1, a3)");
  // If it is not requested, it is omitted. It moves with the loop, so the response is not that of the plant.
  const ProgramResult without = ends("frf log.h5 -o f.h5", 3);
  EXPECT_THAT(without.out,
              testing::ContainsRegex("fault +a2 +is not an input of the sub-plant but moves"));
}

}  // namespace test_damaged_data
}  // namespace stageid::test
