#include "frf/periods/bridge.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace stageid::test_bridge {

constexpr Eigen::Index kSamples = 100;

/// The excitation's part, the same in each period, and a drift of its own: level + slope n.
Eigen::VectorXf drifting_period(float level, float slope) {
  return Eigen::VectorXf::NullaryExpr(kSamples, [&](Eigen::Index n) {
    const auto at = static_cast<float>(n);
    return std::sin(0.3F * at) + level + slope * at;
  });
}

TEST(BridgeSamples, ContinuesTheDriftOfThePeriodAcrossTheGap) {
  std::vector<Eigen::MatrixXf> periods(3);
  for (Eigen::MatrixXf& period : periods) period.resize(kSamples, 2);
  periods[0] << drifting_period(1.0F, 0.01F), drifting_period(0.0F, 0.0F);
  periods[1] << drifting_period(2.0F, 0.03F), drifting_period(5.0F, 0.0F);
  periods[2] << drifting_period(3.0F, 0.05F), drifting_period(1.0F, 0.0F);
  const std::vector<Eigen::MatrixXf> clean = periods;
  const std::vector<std::size_t> reference = {0, 2};
  for (const Eigen::Index count : {1, 10, 30}) {
    periods[1].block(40, 0, count, 2).setConstant(1e3F);
    bridge_samples(periods, reference, 1, {40, 40 + count});
    for (std::size_t p = 0; p < 3; ++p)
      EXPECT_LT((periods[p] - clean[p]).cwiseAbs().maxCoeff(), 1e-4) << p << ", " << count;
  }
}

TEST(BridgeSamples, OneSampleBesideTheGapIsEnough) {
  std::vector<Eigen::MatrixXf> periods(2, Eigen::MatrixXf::Zero(kSamples, 1));
  periods[1](0, 0) = 1.0F;
  periods[1](kSamples - 1, 0) = 1.0F;
  const std::vector<std::size_t> reference = {0};
  bridge_samples(periods, reference, 1, {1, kSamples - 1});
  EXPECT_EQ(periods[1], Eigen::MatrixXf::Ones(kSamples, 1));
}

}  // namespace stageid::test_bridge
