#include "frf/tail_probability.hpp"

#include <gtest/gtest.h>

namespace stageid {
namespace {

// scipy.stats.f.logsf(x, 2 a, 2 b); the second overflows unless it is scaled on the way.
TEST(TailProbability, OfFIsThatOfScipy) {
  EXPECT_NEAR(log_tail_of_f(1.2, 130, 1170.0), -3.8900547289422773, 1e-9);
  EXPECT_NEAR(log_tail_of_f(1.05, 2000, 20000.0), -4.026592717858111, 1e-7);
  EXPECT_NEAR(log_tail_of_f(0.9, 5, 7.5), -0.5881163002608537, 1e-12);
}

// scipy.stats.chi2.sf(2 h, 2 K)
TEST(TailProbability, OfEvidenceIsThatOfScipy) {
  EXPECT_NEAR(tail_of_evidence(12.3, 7), 0.03872784616227062, 1e-12);
  EXPECT_EQ(tail_of_evidence(0.0, 7), 1.0);
  EXPECT_EQ(tail_of_evidence(3.0, 0), 1.0);
}

}  // namespace
}  // namespace stageid
