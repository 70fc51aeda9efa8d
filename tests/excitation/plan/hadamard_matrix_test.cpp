#include "excitation/plan/hadamard_matrix.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/acquisition/files/expect_error.hpp"

namespace stageid::test_hadamard {

TEST(Hadamard, EverySizeItPromisesIsOrthogonal) {
  int sizes = 0;
  for (int n = 1; n <= 128; ++n) {
    if (!has_hadamard_matrix(n)) continue;
    ++sizes;
    const Eigen::MatrixXd H = hadamard_matrix(n);
    EXPECT_TRUE((H.cwiseAbs().array() == 1.0).all()) << n;
    // Sums of n terms of +-1: exact.
    EXPECT_EQ(H * H.transpose(), n * Eigen::MatrixXd::Identity(n, n)) << n;
    EXPECT_TRUE((H.row(0).array() == 1.0).all() && (H.col(0).array() == 1.0).all()) << n;
  }
  // 1, 2 and every multiple of four except 52, 92, 100, 116, up to 128.
  EXPECT_EQ(sizes, 2 + 32 - 4);
}

TEST(Hadamard, HasTheSizesThatPaleyAndSylvesterReach) {
  for (const int n : {1, 2, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48}) {
    EXPECT_TRUE(has_hadamard_matrix(n)) << n;
  }
  for (const int n : {-4, 0, 3, 5, 6, 10, 13, 14, 17, 52, 92}) {
    EXPECT_FALSE(has_hadamard_matrix(n)) << n;
  }
}

TEST(Hadamard, NamesTheNearestSizes) {
  test::expect_error<std::invalid_argument>([] { hadamard_matrix(13); },
                                            "Hadamard matrix: ", "12 and 16");
  EXPECT_THROW(hadamard_matrix(0), std::invalid_argument);
}

}  // namespace stageid::test_hadamard
