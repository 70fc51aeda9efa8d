// Delays are determined from the response, block by block, and not from noise.
#include "frf/wiring/connected_blocks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "frf/runs/channel_choice.hpp"
#include "frf/wiring/skew_check.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_connected_blocks {

using Index = Eigen::Index;

/// Blocks of a rigid body and six modes each, one delay per block, noise of one size on all entries of a line.
std::vector<PlantLine> decoupled_plant(std::uint64_t seed,
                                       const std::vector<std::array<Index, 2>>& shapes,
                                       const std::vector<double>& late_s) {
  test::RandomNumbers random(seed);
  Index n_y = 0;
  Index n_u = 0;
  for (const auto& [rows, columns] : shapes) {
    n_y += rows;
    n_u += columns;
  }
  struct Term {
    double omega = 0.0, damping = 0.0;
    Eigen::MatrixXd R;
  };
  std::vector<std::vector<Term>> terms;
  for (const auto& [rows, columns] : shapes) {
    terms.emplace_back();
    for (int m = 0; m < 9; ++m) {
      Term term;
      term.omega = m < 3 ? 0.0 : 2.0 * std::numbers::pi * random.uniform(170.0, 1900.0);
      term.damping = random.uniform(0.003, 0.015);
      const Eigen::VectorXd y = test::random_vector(random, rows);
      term.R = y * test::random_vector(random, columns).transpose();
      terms.back().push_back(term);
    }
  }
  std::vector<PlantLine> lines;
  for (double hz = 5.0; hz < 2000.0; hz += 5.0) {
    const double omega = 2.0 * std::numbers::pi * hz;
    PlantLine line;
    line.omega_rad_s = omega;
    line.G = Eigen::MatrixXcd::Zero(n_y, n_u);
    Index row = 0;
    Index column = 0;
    for (std::size_t b = 0; b < shapes.size(); ++b) {
      const auto [rows, columns] = shapes[b];
      for (const Term& t : terms[b])
        line.G.block(row, column, rows, columns) +=
            std::polar(1.0, -omega * late_s[b]) * t.R.cast<std::complex<double>>() /
            std::complex<double>(t.omega * t.omega - omega * omega,
                                 2.0 * t.damping * t.omega * omega);
      row += rows;
      column += columns;
    }
    const double noise = 1e-3 * line.G.norm() / std::sqrt(static_cast<double>(line.G.size()));
    line.variance = Eigen::MatrixXd::Constant(n_y, n_u, noise * noise);
    for (auto& value : line.G.reshaped()) value += noise * random.circular();
    line.G0 = line.G;
    lines.push_back(std::move(line));
  }
  return lines;
}

TEST(ConnectedBlocks, AreFoundWhateverTheUnits) {
  std::vector<PlantLine> lines = decoupled_plant(1, {{4, 5}, {3, 4}}, {0.0, 0.0});
  for (PlantLine& line : lines) {
    line.G.bottomRows(3) *= 1e4;  // rad beside m
    line.variance.bottomRows(3) *= 1e8;
  }
  const auto blocks = connected_blocks(lines);
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_EQ(blocks[0].outputs, (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(blocks[0].inputs, (std::vector<Index>{0, 1, 2, 3, 4}));
  EXPECT_EQ(blocks[1].outputs, (std::vector<Index>{4, 5, 6}));
  EXPECT_EQ(blocks[1].inputs, (std::vector<Index>{5, 6, 7, 8}));
}

TEST(ConnectedBlocks, AChannelOfNoiseBelongsToNone) {
  std::vector<PlantLine> lines = decoupled_plant(2, {{4, 4}}, {0.0});
  test::RandomNumbers random(9);
  for (PlantLine& line : lines)
    for (Index j = 0; j < 4; ++j) line.G(2, j) = std::sqrt(line.variance(2, j)) * random.circular();
  const auto blocks = connected_blocks(lines);
  ASSERT_EQ(blocks.size(), 1U);
  EXPECT_EQ(blocks[0].outputs, (std::vector<Index>{0, 1, 3}));
}

// One block is 20 us later than the other: this is a property of the plant, not of a channel.
TEST(SkewOfBlocks, ADelayBetweenBlocksIsNotACharge) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const auto lines = decoupled_plant(seed, {{4, 5}, {3, 4}}, {0.0, 20e-6});
    const SkewCheck check = check_skew(lines, first_indices(7), first_indices(9));
    EXPECT_TRUE(check.errors.empty()) << seed << ": " << check.errors.front().value;
  }
}

TEST(SkewOfBlocks, AChannelThatIsLateInItsBlockIsFound) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    auto lines = decoupled_plant(seed, {{4, 5}, {5, 4}}, {0.0, 20e-6});
    for (PlantLine& line : lines) line.G.row(5) *= std::polar(1.0, -line.omega_rad_s * 12e-6);
    const SkewCheck check = check_skew(lines, first_indices(9), first_indices(9));
    ASSERT_EQ(check.errors.size(), 1U) << seed;
    EXPECT_TRUE(check.errors[0].of_sensors);
    EXPECT_EQ(check.errors[0].a, 5);
    EXPECT_NEAR(check.errors[0].value, 12e-6, 1e-6);
  }
}

TEST(SkewOfBlocks, ABlockOfTwoSaysWhatItNeeds) {
  const SkewCheck none =
      check_skew(decoupled_plant(1, {{2, 2}}, {0.0}), first_indices(2), first_indices(2));
  EXPECT_NE(none.unchecked.find("three sensors and three actuators"), std::string::npos);
  const SkewCheck one = check_skew(decoupled_plant(1, {{4, 4}, {1, 2}}, {0.0, 0.0}),
                                   first_indices(5), first_indices(6));
  EXPECT_NE(one.unchecked.find("decoupled"), std::string::npos);
}

}  // namespace stageid::test_connected_blocks
