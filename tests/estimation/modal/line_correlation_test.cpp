#include "estimation/modal/line_correlation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test_line_correlation {

/// Noise of two outputs and three inputs, each line the mean of `together` independent ones.
FrfEstimate noise(Eigen::Index together, std::uint64_t seed) {
  test::RandomNumbers random(seed);
  const AdditiveModel model = test::named_model(2, 3);
  FrfEstimate frf;
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(2000, 1.0, 2000.0);
  const Eigen::MatrixXcd more = test::circular_matrix(random, 6, 2000 + together);
  frf.response.setZero(6, 2000);
  for (Eigen::Index i = 0; i < together; ++i)
    frf.response += more.middleCols(i, 2000) / std::sqrt(static_cast<double>(together));
  frf.noise_variance.setOnes(6, 2000);
  return frf;
}

double independent(const FrfEstimate& frf) {
  return lines_per_independent(
      frf,
      [](const ResponseBlock& block) {
        return Eigen::MatrixXcd::Zero(block.channels, block.lines).eval();
      },
      frf.noise_variance);
}

// 1 + 2 (4 + 3 + 2 + 1) / 5 for five.
TEST(LineCorrelation, AMeanOfLinesCountsAsSoManyLines) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_EQ(independent(noise(1, seed)), 1.0);
    for (const Eigen::Index together : {2, 5, 12})
      EXPECT_NEAR(independent(noise(together, seed)) / static_cast<double>(together), 1.0, 0.15);
  }
}

TEST(LineCorrelation, AChannelOfUnknownVarianceDoesNotCount) {
  FrfEstimate frf = noise(1, 1);
  frf.response.row(2).setConstant(1e3);
  frf.noise_variance.row(2).setZero();
  EXPECT_EQ(independent(frf), 1.0);
}

}  // namespace stageid::test_line_correlation
