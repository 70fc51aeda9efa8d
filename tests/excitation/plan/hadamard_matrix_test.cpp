#include "excitation/plan/hadamard_matrix.hpp"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>

#include "tests/acquisition/files/expect_error.hpp"

namespace stageid::test_hadamard {

// Sylvester and Paley reach 1, 2 and every multiple of four up to 128 except these.
TEST(Hadamard, EverySizeThatPaleyAndSylvesterReachIsOrthogonal) {
  const std::set<int> without = {52, 92, 100, 116};
  for (int n = -4; n <= 128; ++n) {
    SCOPED_TRACE(n);
    const bool reached = n == 1 || n == 2 || (n > 0 && n % 4 == 0 && !without.contains(n));
    EXPECT_EQ(has_hadamard_matrix(n), reached);
    if (!reached) continue;
    const Eigen::MatrixXd H = hadamard_matrix(n);
    EXPECT_TRUE((H.cwiseAbs().array() == 1.0).all());
    // Sums of n terms of +-1: exact.
    EXPECT_EQ(H * H.transpose(), n * Eigen::MatrixXd::Identity(n, n));
    EXPECT_TRUE((H.row(0).array() == 1.0).all() && (H.col(0).array() == 1.0).all());
  }
}

TEST(Hadamard, NamesTheNearestSizes) {
  test::expect_error<std::invalid_argument>([] { hadamard_matrix(13); },
                                            "Hadamard matrix: ", "12 and 16");
  EXPECT_THROW(hadamard_matrix(0), std::invalid_argument);
}

}  // namespace stageid::test_hadamard
