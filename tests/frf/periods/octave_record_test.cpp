#include "frf/periods/octave_record.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_octave_record {

using Eigen::Index;

constexpr double kRateHz = 1000.0;
constexpr Index kPeriods = 5;
const std::vector<int> kInARow = {0, 1, 2, 3, 4};

/// f(n) of the sample n, samples x periods.
template <typename F>
Eigen::MatrixXd record(Index N, F&& f) {
  return Eigen::VectorXd::NullaryExpr(N * kPeriods, f).reshaped(N, kPeriods);
}

double largest(const OctaveRecord& octave) {
  return octave.detail.array().isNaN().select(0.0, octave.detail.array().abs()).maxCoeff();
}

class OctaveRecords : public testing::TestWithParam<Index> {};
// Four halvings, none, and ten.
INSTANTIATE_TEST_SUITE_P(Lengths, OctaveRecords, testing::Values(400, 375, 1024));

TEST_P(OctaveRecords, DriftsLeaveNothing) {
  const Eigen::MatrixXd drift = record(GetParam(), [](Index n) {
    const double t = 1e-3 * static_cast<double>(n);
    return 3.0 - 2.0 * t + t * t;
  });
  const auto octaves = octave_records(drift, kInARow, kRateHz, 1.0);
  ASSERT_GE(octaves.size(), 5U);
  for (const OctaveRecord& octave : octaves) EXPECT_LT(largest(octave), 1e-9);
}

TEST_P(OctaveRecords, WhatIsPeriodicHasTheSameCoefficientsInEveryPeriod) {
  test::ComplexNoise random(3);
  const Eigen::VectorXd period =
      Eigen::VectorXd::NullaryExpr(GetParam(), [&] { return random.gaussian().real(); });
  for (const OctaveRecord& octave :
       octave_records(period.replicate(1, kPeriods), kInARow, kRateHz, 1.0)) {
    EXPECT_EQ(octave.detail.rows() * octave.step, GetParam());
    for (Index i = 0; i < octave.detail.rows(); ++i)
      EXPECT_NEAR(octave.detail(i, 3), octave.detail(i, 2), 1e-12);
  }
}

TEST_P(OctaveRecords, ASineIsInItsOctave) {
  std::size_t at = 0;
  for (double hz = 375.0; hz > 20.0; hz *= 0.5, ++at) {
    const Eigen::MatrixXd sine = record(GetParam(), [&](Index n) {
      return std::sin(2.0 * std::numbers::pi * hz * static_cast<double>(n) / kRateHz);
    });
    const auto octaves = octave_records(sine, kInARow, kRateHz, 1.0);
    EXPECT_LT(octaves[at].low_hz, hz);
    EXPECT_GT(octaves[at].high_hz, hz);
    for (std::size_t other = 0; other < octaves.size(); ++other) {
      if (other == at) continue;
      EXPECT_LT(largest(octaves[other]), largest(octaves[at])) << hz;
    }
  }
}

// A spike extends as far as stated by the octave, and is assigned to its own period.
TEST_P(OctaveRecords, TheReachOfACoefficientIsKnown) {
  const Index N = GetParam();
  for (const Index at : {Index{0}, N / 2, N - 1}) {
    const Eigen::MatrixXd spike = record(N, [&](Index n) { return n == 2 * N + at ? 1.0 : 0.0; });
    for (const OctaveRecord& octave : octave_records(spike, kInARow, kRateHz, 1.0)) {
      double own = 0.0;
      for (Index p = 0; p < kPeriods; ++p)
        for (Index i = 0; i < octave.detail.rows(); ++i) {
          const double detail = octave.detail(i, p);
          if (!std::isfinite(detail)) {
            EXPECT_TRUE(p + octave.first_period(i) < 0 || p + octave.last_period(i) >= kPeriods);
            continue;
          }
          if (p + octave.first_period(i) > 2 || p + octave.last_period(i) < 2) {
            EXPECT_EQ(detail, 0.0);
          } else if (p == 2) {
            own += detail * detail;
          }
        }
      EXPECT_GT(own, 0.0);
    }
  }
}

TEST(OctaveRecord, IsCutWhereAPeriodIsMissing) {
  const std::vector<int> number = {0, 1, 2, 4, 5};
  const Eigen::MatrixXd steps = record(400, [](Index n) { return n >= 1200 ? 1.0 : 0.0; });
  for (const OctaveRecord& octave : octave_records(steps, number, kRateHz, 1.0)) {
    EXPECT_LT(largest(octave), 1e-12);
    EXPECT_TRUE(std::isnan(octave.detail(0, 3)));
  }
}

}  // namespace stageid::test_octave_record
