#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "acquisition/files/file_error.hpp"
#include "estimation/model/cmif.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_modes_file {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct ModesFile : testing::Test {
  void expect_format_error(const std::string& text, const std::string& place,
                           const std::string& what) {
    std::ofstream(file_, std::ios::binary) << text;
    EXPECT_THAT(
        test::error_message<FormatError>([this] { read_modes(file_); }),
        AllOf(HasSubstr(file_.string() + ":" + place), HasSubstr(what), Not(HasSubstr("\n"))))
        << text;
  }
  static std::string modes(const std::string& list) {
    return R"({"format": "stageid-modes", "modes": )" + list + "}";
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path file_ = directory_ / "modes.json";
};

TEST_F(ModesFile, RoundTripsEveryBit) {
  const std::vector<ModeCandidate> written = {{100.0 / 3.0, 0.01 / 3.0, 1}, {712.4, 0.004, 3}};
  write_modes(file_, written);
  const std::vector<ModeCandidate> read = read_modes(file_);
  ASSERT_EQ(read.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read[i].frequency_hz, written[i].frequency_hz);
    EXPECT_EQ(read[i].damping_ratio, written[i].damping_ratio);
    EXPECT_EQ(read[i].cmif_curve, written[i].cmif_curve);
  }
  write_modes(file_, {});
  EXPECT_TRUE(read_modes(file_).empty());
}

TEST_F(ModesFile, HasTheFieldsOfTheContract) {
  write_modes(file_, {{712.5, 0.25, 2}});
  std::ifstream stream(file_);
  EXPECT_EQ(nlohmann::json::parse(stream), nlohmann::json::parse(R"({"format": "stageid-modes",
    "modes": [{"frequency_hz": 712.5, "damping_ratio": 0.25, "cmif_curve": 2}]})"));
}

TEST_F(ModesFile, ByHandNeedsFrequenciesOnly) {
  std::ofstream(file_) << modes(R"([{"frequency_hz": 100}, {"frequency_hz": 200.5}])");
  const std::vector<ModeCandidate> read = read_modes(file_);
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[1].frequency_hz, 200.5);
  EXPECT_EQ(read[1].damping_ratio, 0.01);
  EXPECT_EQ(read[1].cmif_curve, 1);
}

TEST_F(ModesFile, Refusals) {
  expect_format_error("", "", "empty");
  expect_format_error("{", "", "not JSON");
  expect_format_error(R"({"modes": []})", "", "stageid-modes");
  expect_format_error(R"({"format": "stageid-model", "modes": []})", "", "stageid-modes");
  expect_format_error(R"({"format": "stageid-modes"})", "/", "modes");
  expect_format_error(modes("7"), "/modes", "list");
  expect_format_error(modes("[7]"), "/modes/0", "object");
  expect_format_error(modes("[{}]"), "/modes/0", "frequency_hz");
  expect_format_error(modes(R"([{"frequency_hz": 0}])"), "/modes/0/frequency_hz", "positive");
  expect_format_error(modes(R"([{"frequency_hz": null}])"), "/modes/0/frequency_hz", "number");
  expect_format_error(modes(R"([{"frequency_hz": 1e999}])"), "", "");
  expect_format_error(modes(R"([{"frequency_hz": 1, "damping_ratio": 1}])"),
                      "/modes/0/damping_ratio", "below 1");
  expect_format_error(modes(R"([{"frequency_hz": 1, "damping_ratio": -0.1}])"),
                      "/modes/0/damping_ratio", "positive");
  expect_format_error(modes(R"([{"frequency_hz": 1, "cmif_curve": 0}])"), "/modes/0/cmif_curve",
                      "whole number");
}

TEST_F(ModesFile, FilesThatCannotBeReadOrWritten) {
  EXPECT_THROW((void)read_modes(directory_ / "none.json"), FileError);
  EXPECT_THROW(write_modes(directory_ / "no" / "modes.json", {}), FileError);
}

}  // namespace stageid::test_modes_file
