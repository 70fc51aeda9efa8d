#include "frf/response/frf_estimate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numbers>

#include "tests/support/models/numbered_frf.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_frf_estimate {

using test::numbered_frf;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <typename Call>
std::string message_of(const Call& call) {
  return test::error_message<std::invalid_argument>(call);
}

TEST(FrfEstimate, AtIsAViewOfTheColumnAsAMatrix) {
  const FrfEstimate frf = numbered_frf();
  const auto G = frf.at(2);
  EXPECT_EQ(G.rows(), 2);
  EXPECT_EQ(G.cols(), 3);
  EXPECT_EQ(G(1, 2), frf.response(1 + 2 * 2, 2));
  EXPECT_EQ(G.data(), frf.response.col(2).data());
  EXPECT_DOUBLE_EQ(frf.omega_rad_s()[1], 5.0 * std::numbers::pi);
}

TEST(SelectBand, KeepsTheLinesInsideWithBothEnds) {
  const FrfEstimate frf = numbered_frf();
  const FrfEstimate band = select_band(frf, 2.5, 3.0);
  ASSERT_EQ(band.lines(), 2);
  EXPECT_EQ(band.frequency_hz, (Eigen::VectorXd{{2.5, 3.0}}));
  EXPECT_EQ(band.response, frf.response.middleCols(1, 2));
  EXPECT_EQ(band.noise_variance, frf.noise_variance.middleCols(1, 2));
  EXPECT_EQ(band.total_variance, frf.total_variance.middleCols(1, 2));
  EXPECT_EQ(band.covariance, frf.covariance.middleCols(1, 2));
  EXPECT_EQ(band.input_factor, frf.input_factor.middleCols(1, 2));
  EXPECT_EQ(band.residual_covariance, frf.residual_covariance.middleCols(1, 2));
  EXPECT_EQ(band.input_condition, (Eigen::VectorXd{{2.0, 3.0}}));
  EXPECT_EQ(band.inputs, frf.inputs);
  EXPECT_NO_THROW(check(band));
}

TEST(SelectBand, RefusesAnEmptyBand) {
  const auto message = [](double low_hz, double high_hz) {
    return message_of([&] { select_band(numbered_frf(), low_hz, high_hz); });
  };
  EXPECT_THAT(message(20.0, 30.0),
              AllOf(HasSubstr("20 to 30 Hz"), HasSubstr("lines from 1 to 10 Hz")));
  EXPECT_THAT(message(3.0, 2.5), HasSubstr("is reversed"));
  EXPECT_THAT(message(kNan, 2.5), HasSubstr("no line"));
}

TEST(SelectChannels, PicksAndOrdersEverythingThatBelongsToThem) {
  const FrfEstimate frf = numbered_frf();
  const FrfEstimate part = select_channels(frf, {"a3", "a1"}, {"z2"});
  EXPECT_EQ(part.inputs, (ChannelList{{"a3", "a1"}, {"Nm", "N"}}));
  EXPECT_EQ(part.outputs, (ChannelList{{"z2"}, {"m"}}));
  for (Eigen::Index k = 0; k < 4; ++k) {
    EXPECT_EQ(part.at(k)(0, 0), frf.at(k)(1, 2));
    EXPECT_EQ(part.at(k)(0, 1), frf.at(k)(1, 0));
    EXPECT_EQ(part.noise_variance(0, k), frf.noise_variance(5, k));
    EXPECT_EQ(part.total_variance(1, k), frf.total_variance(1, k));
    EXPECT_EQ(part.residual_covariance(0, k), frf.residual_covariance(3, k));  // (z2, z2)
    EXPECT_EQ(part.input_factor(1, k), frf.input_factor(0 + 3 * 2, k));        // row a1, column a3
    EXPECT_EQ(part.covariance(1, k),
              frf.covariance(1 + 6 * 5, k));  // row z2 <- a1, column z2 <- a3
    EXPECT_EQ(part.covariance(2, k), frf.covariance(5 + 6 * 1, k));  // and vice versa
  }
  EXPECT_NO_THROW(check(part));
}

TEST(SelectChannels, EmptyVariancesStayEmpty) {
  FrfEstimate frf = numbered_frf();
  frf.noise_variance.resize(0, 0);
  frf.covariance.resize(0, 0);
  const FrfEstimate part = select_channels(frf, {"a1"}, {"z1"});
  EXPECT_EQ(part.noise_variance.size(), 0);
  EXPECT_EQ(part.covariance.size(), 0);
  EXPECT_NO_THROW(check(part));
}

TEST(SelectChannels, NamesTheUnknownChannelAndThoseThereAre) {
  const auto message = [](const std::vector<std::string>& inputs,
                          const std::vector<std::string>& outputs) {
    return message_of([&] { select_channels(numbered_frf(), inputs, outputs); });
  };
  EXPECT_THAT(message({"b"}, {"z1"}),
              AllOf(HasSubstr("unknown input 'b'"), HasSubstr("a1, a2, a3")));
  EXPECT_THAT(message({"a1"}, {"a1"}),
              AllOf(HasSubstr("unknown output 'a1'"), HasSubstr("z1, z2")));
  EXPECT_THAT(message({}, {"z1"}), HasSubstr("no input"));
  EXPECT_THAT(message({"a1", "a1"}, {"z1"}), HasSubstr("duplicate"));
}

struct Fault {
  const char* name;
  std::function<void(FrfEstimate&)> spoil;
  const char* message;
};

class CheckFrf : public testing::TestWithParam<Fault> {};

TEST_P(CheckFrf, NamesThePlace) {
  FrfEstimate frf = numbered_frf();
  EXPECT_NO_THROW(check(frf));
  GetParam().spoil(frf);
  EXPECT_THAT(message_of([&] { check(frf); }), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, CheckFrf,
    testing::Values(
        Fault{"nan", [](FrfEstimate& f) { f.response(4, 2) = kNan; },
              "response[line 2, z1 <- a3]: not finite"},
        Fault{"infinity", [](FrfEstimate& f) { f.response(1, 0).imag(-1.0 / 0.0); },
              "response[line 0, z2 <- a1]: not finite"},
        Fault{"shape", [](FrfEstimate& f) { f.response.conservativeResize(5, 4); },
              "response: 5 values"},
        Fault{"lines", [](FrfEstimate& f) { f.noise_variance.conservativeResize(6, 3); },
              "noise_variance: 6 values on 3 lines"},
        Fault{"negative", [](FrfEstimate& f) { f.total_variance(0, 1) = -1e-9; },
              "total_variance[line 1, z1 <- a1]: a variance must be 0 or more"},
        Fault{"variance_nan", [](FrfEstimate& f) { f.noise_variance(5, 3) = kNan; },
              "noise_variance[line 3, z2 <- a3]: not finite"},
        Fault{"frequency_order", [](FrfEstimate& f) { f.frequency_hz[2] = 2.5; },
              "frequency_hz[line 2]: 2.5 Hz after 2.5 Hz"},
        Fault{"frequency_nan", [](FrfEstimate& f) { f.frequency_hz[1] = kNan; },
              "frequency_hz[line 1]"},
        Fault{"frequency_negative", [](FrfEstimate& f) { f.frequency_hz[0] = -1.0; },
              "frequency_hz[line 0]"},
        Fault{"above_nyquist", [](FrfEstimate& f) { f.sample_rate_hz = 19.0; },
              "above half the sample rate"},
        Fault{"no_line",
              [](FrfEstimate& f) {
                f.frequency_hz.resize(0);
                f.response.resize(6, 0);
              },
              "frequency_hz: no line"},
        Fault{"no_input", [](FrfEstimate& f) { f.inputs = {}; }, "inputs: no channel"},
        Fault{"units", [](FrfEstimate& f) { f.outputs.units.pop_back(); },
              "outputs: 1 unit for 2 channels"},
        Fault{"same_name", [](FrfEstimate& f) { f.inputs.names[2] = "a1"; },
              "inputs: duplicate channel name 'a1'"},
        Fault{"rate", [](FrfEstimate& f) { f.sample_rate_hz = -1.0; }, "sample_rate_hz"},
        Fault{"delay", [](FrfEstimate& f) { f.delay_s = kNan; }, "delay_s"},
        Fault{"dof", [](FrfEstimate& f) { f.noise_dof = -1.0; }, "noise_dof"},
        Fault{"residual", [](FrfEstimate& f) { f.residual_covariance(0, 3) = kNan; },
              "residual_covariance[line 3]: not finite"},
        Fault{"input_factor", [](FrfEstimate& f) { f.input_factor(2, 1) = kNan; },
              "input_factor[line 1]: not finite"},
        Fault{"covariance", [](FrfEstimate& f) { f.covariance(7, 1).imag(kNan); },
              "covariance[line 1]: not finite"},
        Fault{"condition", [](FrfEstimate& f) { f.input_condition[2] = kNan; },
              "input_condition[line 2]: not finite"},
        Fault{"condition_size", [](FrfEstimate& f) { f.input_condition.conservativeResize(3); },
              "input_condition: 1 values on 3 lines"},
        Fault{"excluded", [](FrfEstimate& f) { f.excluded_channels.pop_back(); },
              "excluded_power: 2 values for 1 channels"}),
    [](const auto& fault) { return fault.param.name; });

}  // namespace stageid::test_frf_estimate
