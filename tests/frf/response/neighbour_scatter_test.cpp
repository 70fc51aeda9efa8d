#include "frf/response/neighbour_scatter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_neighbour_scatter {

constexpr Eigen::Index kLines = 400;
constexpr double kNoise = 1e-4;         // variance of the first channel
constexpr double kDistortion = 2.5e-3;  // as large on every line

/// Two outputs, one input, two modes some lines wide; circular errors of variance `kNoise + distortion` times 1 and 9.
/// The FRF's noise variance is the part of the noise.
FrfEstimate plant(double distortion, std::uint64_t seed) {
  FrfEstimate frf;
  frf.inputs = {{"u"}, {"N"}};
  frf.outputs = {{"y1", "y2"}, {"m", "m"}};
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(kLines, 1.0, 100.0);
  frf.response.resize(2, kLines);
  frf.noise_variance.resize(2, kLines);
  test::RandomNumbers random(seed);
  for (Eigen::Index k = 0; k < kLines; ++k) {
    const double f = frf.frequency_hz[k];
    const auto mode = [f](double f_0, double zeta) {
      return 1.0 / std::complex<double>(1.0 - f * f / (f_0 * f_0), 2.0 * zeta * f / f_0);
    };
    const std::complex<double> a = mode(30.0, 0.02);
    const std::complex<double> b = mode(70.0, 0.02);
    frf.response.col(k) << a + b, a - b;
    for (Eigen::Index c = 0; c < 2; ++c) {
      const double scale = c == 0 ? 1.0 : 3.0;
      frf.response(c, k) += scale * std::sqrt(kNoise + distortion) * random.circular();
      frf.noise_variance(c, k) = scale * scale * kNoise;
    }
  }
  return frf;
}

// The median of Gamma(9)/9, the distribution of a variance of nine complex degrees of freedom, is 0.963.
constexpr double kMedian = 0.963;

TEST(LineScatter, OfALinearPlantItIsTheNoise) {
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const LineScatter scatter = line_scatter(plant(0.0, seed));
    EXPECT_NEAR(scatter.over_noise, kMedian, 0.15);
    sum += (scatter.variance.array() / plant(0.0, seed).noise_variance.array()).mean();
  }
  // 20 x 400 lines of two channels, twelve of them together: a standard deviation of less than 0.01. The flanks of the
  // modes, 68 dB above the noise, leave 0.04.
  EXPECT_NEAR(sum / 20.0, 1.0, 0.06);
}

TEST(LineScatter, OfADistortedPlantItHoldsTheDistortion) {
  const FrfEstimate frf = plant(kDistortion, 5);
  const LineScatter scatter = line_scatter(frf);
  const double expected = (kNoise + kDistortion) / kNoise;
  EXPECT_NEAR(scatter.over_noise, kMedian * expected, 0.1 * expected);
  for (Eigen::Index c = 0; c < 2; ++c)
    EXPECT_NEAR(scatter.variance.row(c).mean() / frf.noise_variance(c, 0), expected,
                0.1 * expected);
  EXPECT_EQ(scatter.dof, 9.0);
}

TEST(LineScatter, WithoutANoiseVarianceOrEnoughLinesTheRatioIsUnknown) {
  FrfEstimate frf = plant(0.0, 3);
  const LineScatter few = line_scatter(select_band(frf, 1.0, 3.0));
  EXPECT_EQ(few.variance.size(), 0);
  EXPECT_EQ(few.over_noise, 0.0);
  frf.noise_variance.resize(0, 0);
  EXPECT_EQ(line_scatter(frf).over_noise, 0.0);
  EXPECT_EQ(line_scatter(frf).variance.cols(), kLines);
}

}  // namespace stageid::test_neighbour_scatter
