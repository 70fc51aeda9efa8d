#pragma once

#include <gtest/gtest.h>

#include "estimation/problem/fit_options.hpp"

namespace stageid::test {

/// Expects the same bits in two fits: their way, their models and their deviations.
inline void expect_same(const FitResult& a, const FitResult& b) {
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.decisions, b.decisions);
  EXPECT_EQ(a.removal_cost, b.removal_cost);
  EXPECT_EQ(a.model.fit.relative_rms_error, b.model.fit.relative_rms_error);
  EXPECT_TRUE(a.model.input_delay_s == b.model.input_delay_s);
  EXPECT_TRUE(a.model.output_delay_s == b.model.output_delay_s);
  ASSERT_EQ(a.response_variance.size(), b.response_variance.size());
  EXPECT_TRUE(a.response_variance == b.response_variance);
  ASSERT_EQ(a.model.submodels.size(), b.model.submodels.size());
  for (std::size_t i = 0; i < a.model.submodels.size(); ++i) {
    SCOPED_TRACE(i);
    const Submodel& s = a.model.submodels[i];
    const Submodel& t = b.model.submodels[i];
    EXPECT_EQ(s.denominator, t.denominator);
    EXPECT_EQ(s.natural_frequency_std_hz, t.natural_frequency_std_hz);
    EXPECT_TRUE(s.numerator == t.numerator);
    EXPECT_TRUE(s.numerator_std == t.numerator_std);
  }
}

}  // namespace stageid::test
