#include "frf/response/responding_channels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <random>

namespace stageid::test_responding_channels {

/// Two channels of one input: responses of `first` and `second` standard deviations, in noise of one.
FrfEstimate two_channels(double first, double second, std::uint64_t seed) {
  constexpr Eigen::Index kLines = 400;
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal(0.0, std::sqrt(0.5));
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 400.0);
  frf.inputs = {{"a1"}, {"N"}};
  frf.outputs = {{"s1", "s2"}, {"m", "m"}};
  frf.noise_variance = Eigen::MatrixXd::Ones(2, kLines);
  frf.noise_dof = 6.0;
  frf.response.resize(2, kLines);
  for (Eigen::Index k = 0; k < kLines; ++k)
    for (Eigen::Index c = 0; c < 2; ++c)
      frf.response(c, k) =
          (c == 0 ? first : second) + std::complex<double>(normal(engine), normal(engine));
  return frf;
}

TEST(RespondingChannels, NoiseAloneIsNoResponse) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const ChannelFlags flags = responding_channels(two_channels(5.0, 0.0, seed));
    EXPECT_TRUE(flags[0]) << seed;
    EXPECT_FALSE(flags[1]) << seed;
  }
}

TEST(RespondingChannels, WithoutVariancesOnlyZeroIsNone) {
  FrfEstimate frf = two_channels(5.0, 0.0, 1);
  frf.noise_variance.resize(0, 0);
  EXPECT_TRUE(responding_channels(frf)[1]);
  frf.response.row(1).setZero();
  EXPECT_TRUE(responding_channels(frf)[0]);
  EXPECT_FALSE(responding_channels(frf)[1]);
}

TEST(RespondingChannels, ErrorsAreOverWhatIsFlaggedAndNotZero) {
  const Eigen::ArrayXXd error{{1.0, 4.0}, {9.0, 9.0}};
  const Eigen::ArrayXXd power{{4.0, 0.0}, {9.0, 36.0}};
  const Eigen::ArrayX2d squares = relative_squares(error, power);
  EXPECT_DOUBLE_EQ(relative_rms_error(squares, ChannelFlags{{true, false}}), 0.5);
  EXPECT_DOUBLE_EQ(relative_rms_error(squares, ChannelFlags{{false, true}}), std::sqrt(1.25 / 2.0));
  EXPECT_DOUBLE_EQ(relative_rms_error(squares, ChannelFlags{{true, true}}),
                   std::sqrt((0.25 + 1.0 + 0.25) / 3.0));
  EXPECT_TRUE(std::isnan(relative_rms_error(squares, ChannelFlags{{false, false}})));
}

}  // namespace stageid::test_responding_channels
