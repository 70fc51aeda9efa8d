#include "tools/workbench/edit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimation/request/request_flags.hpp"

namespace stageid::test_workbench_edit {

using Json = nlohmann::json;
using Modes = ModesRequest::Kind;

FitRequest two_modes() {
  FitRequest request;
  request.modes = {Modes::given, 0, {{100.0, 0.01}, {200.0, 0.02}}};
  return request;
}

std::string flags_after(const Json& action, const FitRequest& request = two_modes()) {
  return flags_of(edited(action, request).request).dump();
}

void refused(const Json& action, const std::string& why) {
  EXPECT_THAT([&] { edited(action, two_modes()); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(why)))
      << action.dump();
}

TEST(WorkbenchEdit, AddsAModeInOrderRounded) {
  EXPECT_EQ(
      flags_after(
          {{"kind", "add"}, {"frequency_hz", 150.123456789}, {"damping_ratio", 0.0051234567}}),
      R"({"--modes":"100,150.1235:0.005123,200:0.02"})");
  EXPECT_EQ(flags_after({{"kind", "add"}, {"frequency_hz", 50}}, {}), R"({"--modes":"50,"})");
  EXPECT_EQ(edited({{"kind", "add"}, {"frequency_hz", 50}}, {}).what, "added 50 Hz");
}

TEST(WorkbenchEdit, RemovesTheNearestMode) {
  EXPECT_EQ(flags_after({{"kind", "remove"}, {"frequency_hz", 200.01}}), R"({"--modes":"100,"})");
  refused({{"kind", "remove"}, {"frequency_hz", 201.0}}, "no mode at 201 Hz");
  FitRequest one = two_modes();
  one.modes.given.pop_back();
  EXPECT_EQ(flags_after({{"kind", "remove"}, {"frequency_hz", 100}}, one), R"({"--modes":"none"})");
}

TEST(WorkbenchEdit, SetsTheBand) {
  EXPECT_EQ(edited({{"kind", "band"}, {"low_hz", 20}, {"high_hz", 800.5}}, {}).request.band_hz,
            (std::array<double, 2>{20.0, 800.5}));
  FitRequest banded;
  banded.band_hz = {1.0, 2.0};
  EXPECT_FALSE(edited({{"kind", "band"}, {"low_hz", nullptr}}, banded).request.band_hz);
  refused({{"kind", "band"}, {"low_hz", 20}, {"high_hz", 10}}, "high_hz");
}

TEST(WorkbenchEdit, RefitsWithTheWordsOfTheFlagsAndKeepsTheOthers) {
  FitRequest request = two_modes();
  request.general_damping = true;
  const Edit edit =
      edited({{"kind", "refit"}, {"weighting", "relative"}, {"delay", "1e-4"}}, request);
  EXPECT_EQ(
      flags_of(edit.request).dump(),
      R"({"--modes":"100,200:0.02","--weighting":"relative","--delay":"0.0001","--damping":"general"})");
  EXPECT_EQ(edit.what, "weighting: relative, delay: 1e-4");
  EXPECT_EQ(flags_after({{"kind", "refit"}, {"damping", ""}}, request),
            R"({"--modes":"100,200:0.02"})");
  EXPECT_EQ(edited({{"kind", "refit"}, {"modes", "auto"}}, request).request.modes.kind,
            Modes::search);
  EXPECT_EQ(edited({{"kind", "refit"}, {"modes", "7"}}, request).request.modes.count, 7);
}

TEST(WorkbenchEdit, NothingInAnActionNamesAFile) {
  FitRequest weighted = two_modes();
  weighted.weighting = Weighting::user;
  weighted.weight_file = "weights.h5";
  for (const char* word : {"/etc/passwd", "../w.h5", "w.h5", "user"})
    refused({{"kind", "refit"}, {"weighting", word}}, "weighting");
  for (const char* word : {"/etc/passwd", "modes.json", "1e3", "-1", "12345"})
    refused({{"kind", "refit"}, {"modes", word}}, "modes");
  const FitRequest kept = edited({{"kind", "refit"}, {"damping", "general"}}, weighted).request;
  EXPECT_EQ(kept.weight_file, "weights.h5");
  EXPECT_EQ(kept.weighting, Weighting::user);
}

TEST(WorkbenchEdit, RefusesWhatIsNotAnAction) {
  refused({{"kind", "launch"}}, "unknown action");
  refused({{"kind", 7}}, "unknown action");
  refused({{"kind", "add"}}, "frequency_hz");
  refused({{"kind", "add"}, {"frequency_hz", "12"}}, "frequency_hz");
  refused({{"kind", "add"}, {"frequency_hz", -1}}, "frequency_hz");
  refused({{"kind", "add"}, {"frequency_hz", 10}, {"damping_ratio", 1.0}}, "damping_ratio");
  refused({{"kind", "refit"}, {"delay", std::string(65, '1')}}, "delay");
  refused({{"kind", "refit"}, {"rigid_body", "many"}}, "--rigid-body");
}

TEST(WorkbenchEdit, TheControlsShowTheRequest) {
  FitRequest request = two_modes();
  request.direct_term = true;
  request.residue_rank = 1;
  request.band_hz = {20.0, 800.0};
  EXPECT_EQ(
      controls_json(request),
      Json::parse(R"({"band_hz": [20.0, 800.0], "weighting": "", "damping": "", "residue_rank": "1",
                            "delay": "", "rigid_body": "", "direct_term": "full"})"));
}

}  // namespace stageid::test_workbench_edit
