#include "frf/runs/channel_scan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_channel_scan {

Eigen::VectorXd normal_samples(Eigen::Index n, std::uint64_t seed) {
  test::RandomNumbers random(seed);
  return test::random_vector(random, n);
}

// A slow signal behind a coarse converter repeats values for long everywhere; a stuck channel does so once.
TEST(ChannelScan, ExpectsTheRepetitionsOfACoarseConverter) {
  const Eigen::VectorXd noise = normal_samples(100000, 3);
  Eigen::VectorXd slow(noise.size());
  double state = 0.0;
  for (Eigen::Index i = 0; i < noise.size(); ++i)
    slow[i] = state = 0.9 * state + std::sqrt(0.19) * noise[i];
  ChannelScan coarse;
  coarse.add(Eigen::VectorXd((slow / 2.0).array().round()));
  EXPECT_GT(coarse.expected_constant(), 0.5 * static_cast<double>(coarse.longest_constant()));
  EXPECT_LT(coarse.expected_constant(), 2.0 * static_cast<double>(coarse.longest_constant()));
  slow.segment(20000, 2000).setZero();
  ChannelScan stuck;
  stuck.add(slow);
  EXPECT_LT(100.0 * stuck.expected_constant(), static_cast<double>(stuck.longest_constant()));
  EXPECT_TRUE(coarse.is_coarse());
  EXPECT_FALSE(stuck.is_coarse());
  ChannelScan unplugged;  // in all of its runs
  for (int run = 0; run < 6; ++run) {
    unplugged.break_off();
    unplugged.add(Eigen::VectorXd::Constant(1000, 0.5));
  }
  EXPECT_FALSE(unplugged.is_coarse());
}

/// The definition, sample by sample.
std::uint64_t longest_stretch(const Eigen::VectorXd& x) {
  std::uint64_t longest = 0;
  std::uint64_t stretch = 0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    stretch = i > 0 && x[i] == x[i - 1] ? stretch + 1 : 1;
    longest = std::max(longest, stretch);
  }
  return longest;
}

TEST(ChannelScan, NothingIsMissedWhereverItStands) {
  for (Eigen::Index at = 600; at < 624; ++at) {  // around borders between pieces of 256
    Eigen::VectorXd x = normal_samples(3000, static_cast<std::uint64_t>(at));
    if (at % 2 == 0) x = (x * 4.0).array().round();  // values recur far apart
    x.segment(at, 5).setConstant(x.maxCoeff());
    x.segment(2048 + at, 3).setConstant(x.minCoeff());
    std::map<double, std::uint64_t> count;
    for (const double value : x) ++count[value];
    ChannelScan scan;
    scan.add(x.head(100));
    scan.add(x.tail(2900));
    EXPECT_EQ(scan.longest_constant(), longest_stretch(x)) << at;
    EXPECT_EQ(scan.high().value, count.rbegin()->first) << at;
    EXPECT_EQ(scan.high().count, count.rbegin()->second) << at;
    EXPECT_EQ(scan.high().next, std::next(count.rbegin())->first) << at;
    EXPECT_EQ(scan.high().next_count, std::next(count.rbegin())->second) << at;
    EXPECT_EQ(scan.low().value, count.begin()->first) << at;
    EXPECT_EQ(scan.low().count, count.begin()->second) << at;
    EXPECT_EQ(scan.low().next, std::next(count.begin())->first) << at;
    EXPECT_EQ(scan.low().next_count, std::next(count.begin())->second) << at;
    EXPECT_EQ(scan.samples(), 3000U) << at;
    ChannelScan first;
    ChannelScan second;
    first.add(x.head(2000));
    second.add(x.tail(1000));
    first.add(second);
    EXPECT_EQ(first.high().count, scan.high().count) << at;
    EXPECT_EQ(first.low().count, scan.low().count) << at;
    EXPECT_EQ(first.samples(), scan.samples()) << at;
    EXPECT_EQ(first.is_coarse(), at % 2 == 0) << at;
    if (x[1999] != x[2000]) {  // otherwise the parts share a sequence
      EXPECT_EQ(first.expected_constant(), scan.expected_constant()) << at;
    }
  }
}

TEST(ChannelScan, ClippedSamplesPileUpAndOthersDoNot) {
  const double limit = std::log(1e-6);
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Eigen::VectorXd x = normal_samples(4000, seed);
    ChannelScan clean;
    clean.add(x);
    EXPECT_GE(clean.log_p_high(), limit) << seed;
    // A coarse converter repeats its outermost level, but not more often than the adjacent one.
    ChannelScan coarse;
    coarse.add((x * 4.0).array().round().matrix());
    EXPECT_GE(coarse.log_p_high(), limit) << seed;
    EXPECT_GE(coarse.log_p_low(), limit) << seed;
    // 2 % of the samples are above 2.05.
    ChannelScan clipped;
    clipped.add(x.cwiseMin(2.05));
    EXPECT_LT(clipped.log_p_high(), limit) << seed;
    EXPECT_GE(clipped.log_p_low(), limit) << seed;
  }
}

}  // namespace stageid::test_channel_scan
