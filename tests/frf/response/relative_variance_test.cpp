#include "frf/response/relative_variance.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace stageid {
namespace test_relative_variance {

/// Two outputs in different units, two inputs, two lines.
FrfEstimate small_frf() {
  FrfEstimate frf;
  frf.frequency_hz.resize(2);
  frf.frequency_hz << 1.0, 2.0;
  frf.inputs = {{"u1", "u2"}, {"N", "N"}};
  frf.outputs = {{"y1", "y2"}, {"m", "rad"}};
  frf.response.resize(4, 2);  // y1u1, y2u1, y1u2, y2u2
  frf.response << 3.0, 1.0, 10.0, 1.0, std::complex<double>(0.0, 4.0), 0.0, 0.0, 1.0;
  frf.noise_variance.resize(4, 2);
  frf.noise_variance << 1.0, 0.5, 2.0, 1.0, 1.5, 0.5, 1.0, 1.0;
  return frf;
}

TEST(RelativeVariance, IsTheMeanOverLinesAndOutputs) {
  // Line 1: 2.5 / 25 and 3 / 100; line 2: 1 / 1 and 2 / 2.
  EXPECT_DOUBLE_EQ(mean_relative_variance(small_frf(), VarianceKind::noise),
                   ((0.1 + 0.03) / 2.0 + 1.0) / 2.0);
}

TEST(RelativeVariance, DoesNotDependOnTheUnitOfAnOutput) {
  FrfEstimate frf = small_frf();
  const double before = mean_relative_variance(frf, VarianceKind::noise);
  for (const int row : {1, 3}) {
    frf.response.row(row) *= 1e6;
    frf.noise_variance.row(row) *= 1e12;
  }
  EXPECT_DOUBLE_EQ(mean_relative_variance(frf, VarianceKind::noise), before);
}

TEST(RelativeVariance, RefusesWhatHasNone) {
  FrfEstimate frf = small_frf();
  EXPECT_THROW(mean_relative_variance(frf, VarianceKind::total), std::invalid_argument);
  frf.response.row(0).setZero();
  frf.response.row(2).setZero();
  EXPECT_THROW(mean_relative_variance(frf, VarianceKind::noise), std::invalid_argument);
  frf.noise_variance.resize(0, 0);
  EXPECT_THROW(mean_relative_variance(frf, VarianceKind::noise), std::invalid_argument);
}

}  // namespace test_relative_variance
}  // namespace stageid
