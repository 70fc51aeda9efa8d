#include "tools/fit/fit_words.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquisition/files/file_error.hpp"
#include "estimation/model/cmif.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_fit_words {

using Modes = ModesRequest::Kind;
using Body = RigidBodyRequest::Kind;

FitRequest parsed(const FitWords& flags) {
  FitRequest request;
  parse_fit_words(flags, request);
  return request;
}

FitRequest with(std::string FitWords::*flag, const std::string& text) {
  FitWords flags;
  flags.*flag = text;
  return parsed(flags);
}

TEST(FitWords, WithoutFlagsTheRequestIsTheDefault) {
  const FitRequest request = parsed({});
  EXPECT_EQ(request.modes.kind, Modes::by_submodels);
  EXPECT_EQ(request.rigid_body.kind, Body::by_submodels);
  EXPECT_FALSE(request.weighting || request.hold || request.delay);
  EXPECT_FALSE(request.general_damping || request.direct_term);
  EXPECT_EQ(request.residue_rank, 0);
  EXPECT_EQ(request.method, FitMethod::riv);
}

TEST(FitWords, ModesAreACountFrequenciesOrAFile) {
  const test::TemporaryDirectory directory;
  write_modes(directory / "modes.json", {{12.0, 0.02, 1}, {34.0, 0.03, 2}});
  const auto modes = [](const std::string& text) { return with(&FitWords::modes, text).modes; };
  EXPECT_EQ(modes("1").kind, Modes::count);
  EXPECT_EQ(modes("1").count, 1);
  EXPECT_EQ(modes("auto").kind, Modes::search);
  EXPECT_EQ(modes("none").kind, Modes::none);
  ASSERT_EQ(modes("30.5,12").given.size(), 2U);
  EXPECT_EQ(modes("30.5,12").given[0].frequency_hz, 12.0);
  EXPECT_EQ(modes("76.2").given.at(0).frequency_hz, 76.2);  // a point makes it a frequency
  EXPECT_EQ(modes("76,").given.at(0).frequency_hz, 76.0);   // so does a comma
  const std::vector<ModeCandidate> damped = modes("30.5:0.002,12").given;
  ASSERT_EQ(damped.size(), 2U);
  EXPECT_EQ(damped[0].damping_ratio, 0.01);
  EXPECT_EQ(damped[1].damping_ratio, 0.002);
  EXPECT_EQ(modes("76:0.5").given.at(0).damping_ratio, 0.5);
  for (const char* text : {"76:", "76:1", "76:0,", "76:-0.1,80", ":0.01", "76:0.1:0.2"})
    EXPECT_THAT([&] { modes(text); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("--modes")))
        << text;
  const ModesRequest by_file = modes((directory / "modes.json").string());
  ASSERT_EQ(by_file.given.size(), 2U);
  EXPECT_EQ(by_file.kind, Modes::given);
  EXPECT_EQ(by_file.given[1].damping_ratio, 0.03);
  EXPECT_THROW(modes("missing.json"), FileError);
}

TEST(FitWords, TheRigidBodyIsAWordARankOrASuspension) {
  const auto body = [](const std::string& text) {
    return with(&FitWords::rigid_body, text).rigid_body;
  };
  EXPECT_EQ(body("auto").kind, Body::automatic);
  EXPECT_EQ(body("full").kind, Body::free);
  EXPECT_EQ(body("full").rank, 0);
  EXPECT_EQ(body("3").rank, 3);
  EXPECT_EQ(body("suspension").kind, Body::suspension);
  EXPECT_EQ(body("suspension:0.4:0.5").suspension_hz, (std::vector<double>{0.4, 0.5}));
  for (const char* text : {"suspension:", "suspension:0.4:", "suspension0.4", "suspension:-1"})
    EXPECT_THAT([&] { body(text); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("--rigid-body")))
        << text;
}

TEST(FitWords, WordsBecomeValues) {
  EXPECT_EQ(with(&FitWords::weighting, "total_variance").weighting, Weighting::total_variance);
  EXPECT_EQ(with(&FitWords::weighting, "w.h5").weighting, Weighting::user);
  EXPECT_EQ(with(&FitWords::weighting, "w.h5").weight_file, "w.h5");
  EXPECT_EQ(with(&FitWords::hold, "sinc").hold, HoldModel::sinc);
  EXPECT_EQ(with(&FitWords::delay, "per_channel").delay->model, DelayModel::per_channel);
  EXPECT_EQ(with(&FitWords::delay, "-1e-4").delay->delay_s, -1e-4);
  EXPECT_EQ(with(&FitWords::damping, "general").general_damping, true);
  EXPECT_EQ(with(&FitWords::direct_term, "none").direct_term, false);
  EXPECT_EQ(with(&FitWords::method, "sk").method, FitMethod::sk);
  EXPECT_EQ(with(&FitWords::residue_rank, "2").residue_rank, 2);
}

TEST(FitWords, EveryWordThatIsNotOneIsRefused) {
  const auto refused = [](auto member, const char* value) {
    FitWords flags;
    FitRequest request;
    flags.*member = value;
    EXPECT_THROW(parse_fit_words(flags, request), std::invalid_argument) << value;
  };
  refused(&FitWords::hold, "zoh");
  refused(&FitWords::weighting, "user");
  refused(&FitWords::weighting, "noise");
  refused(&FitWords::delay, "inf");
  refused(&FitWords::modes, "-3");
  refused(&FitWords::modes, "12,-3");
  refused(&FitWords::rigid_body, "half");
  refused(&FitWords::damping, "viscous");
  refused(&FitWords::direct_term, "half");
  refused(&FitWords::method, "lm");
}

}  // namespace stageid::test_fit_words
