#include "excitation/multisine/frequency_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>

#include "tests/acquisition/files/expect_error.hpp"
#include "tests/excitation/reference/multisine_reference.hpp"

namespace stageid::test_frequency_grid {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(FrequencyGrid, IsThePapersGridOfFourThousandOddLines) {
  const auto grid = FrequencyGrid::band(10'000.0, 40'000, {.low_hz = 0.25, .high_hz = 2000.0});
  ASSERT_EQ(grid.size(), 4000);
  EXPECT_EQ(grid.frequency_hz()[0], 0.25);
  EXPECT_EQ(grid.frequency_hz()[3999], 1999.75);
  EXPECT_EQ(grid.resolution_hz(), 0.25);
  EXPECT_EQ(grid.period_s(), 4.0);
}

TEST(FrequencyGrid, HoldsBothEndsOfTheBand) {
  // 0.3 / 0.1 and 0.7 / 0.1 are not 3 and 7 in binary, but the band edges must count.
  const auto grid = FrequencyGrid::band(
      10.0, 100, {.low_hz = 0.3, .high_hz = 0.7, .selection = LineSelection::all});
  EXPECT_EQ(grid.lines(), (std::vector<int>{3, 4, 5, 6, 7}));
}

TEST(FrequencyGrid, NeverExcitesZeroFrequencyNorHalfTheRate) {
  for (const int samples : {9, 10}) {
    const auto grid = FrequencyGrid::band(
        10.0, samples, {.low_hz = 0.0, .high_hz = 4.999999, .selection = LineSelection::all});
    EXPECT_EQ(grid.lines(), (std::vector<int>{1, 2, 3, 4})) << samples;
  }
}

TEST(FrequencyGrid, ConvertsLinesToHertzAndRadiansOnce) {
  const FrequencyGrid grid(1000.0, 3000, {1, 10, 1499});
  for (Eigen::Index k = 0; k < 3; ++k) {
    const double wanted = grid.lines()[k] / 3.0;
    EXPECT_DOUBLE_EQ(grid.frequency_hz()[k], wanted);
    EXPECT_DOUBLE_EQ(grid.omega_rad_s()[k], 2.0 * std::numbers::pi * wanted);
  }
}

TEST(FrequencyGrid, LeavesOneOddLineOfEveryGroupOut) {
  for (const int group : {2, 3, 4, 7}) {
    const auto grid = FrequencyGrid::band(1000.0, 2000,
                                          {.low_hz = 0.5,
                                           .high_hz = 420.0,
                                           .selection = LineSelection::odd_random,
                                           .group_size = group,
                                           .seed = 5});
    std::set<int> places;
    const std::set<int> lines(grid.lines().begin(), grid.lines().end());
    const int odd_lines = 420;  // 1, 3 ... 839
    for (int first = 0; first < odd_lines; first += group) {
      int missing = 0;
      for (int i = first; i < std::min(first + group, odd_lines); ++i) {
        if (lines.contains(2 * i + 1)) continue;
        ++missing;
        places.insert(i - first);
      }
      EXPECT_EQ(missing, first + group <= odd_lines ? 1 : 0) << "group from " << 2 * first + 1;
    }
    EXPECT_EQ(places.size(), static_cast<std::size_t>(group)) << "some places are never left out";
  }
}

TEST(FrequencyGrid, DrawsTheLinesOfTheIndependentReference) {
  const auto grid = FrequencyGrid::band(
      200.0, 200,
      {.low_hz = 1.0, .high_hz = 99.5, .selection = LineSelection::odd_random, .seed = 7});
  EXPECT_EQ(grid.lines(), test::reference::kOddRandomLines);
  const auto other = FrequencyGrid::band(
      200.0, 200,
      {.low_hz = 1.0, .high_hz = 99.5, .selection = LineSelection::odd_random, .seed = 8});
  EXPECT_NE(other, grid);
}

/// Expects an std::invalid_argument with `word` in its message.
void expect_refused(double rate_hz, int samples, const LineSpec& spec, const std::string& word) {
  test::expect_error<std::invalid_argument>([&] { FrequencyGrid::band(rate_hz, samples, spec); },
                                            "frequency ", word);
}

TEST(FrequencyGrid, RefusesBandsThatCannotBeMeasured) {
  expect_refused(100.0, 100, {.low_hz = 20.0, .high_hz = 10.0}, "reversed");
  expect_refused(100.0, 100, {.low_hz = 1.0, .high_hz = 50.0}, "half the sample rate");
  expect_refused(100.0, 100, {.low_hz = 1.0, .high_hz = 51.0}, "half the sample rate");
  expect_refused(100.0, 100, {.low_hz = 1.2, .high_hz = 1.8}, "no odd line");
  expect_refused(100.0, 100, {.low_hz = 2.0, .high_hz = 2.0}, "no odd line");
  expect_refused(100.0, 100, {.low_hz = 0.0, .high_hz = 0.0, .selection = LineSelection::all},
                 "no line");
  expect_refused(100.0, 100, {.low_hz = -1.0, .high_hz = 10.0}, "negative");
  expect_refused(100.0, 100, {.low_hz = kNan, .high_hz = 10.0}, "finite");
  expect_refused(100.0, 100, {.low_hz = 1.0, .high_hz = kNan}, "finite");
  expect_refused(0.0, 100, {.low_hz = 1.0, .high_hz = 10.0}, "sample rate");
  expect_refused(100.0, 2, {.low_hz = 1.0, .high_hz = 10.0}, "at least 3 samples");
  expect_refused(
      100.0, 100,
      {.low_hz = 1.0, .high_hz = 10.0, .selection = LineSelection::odd_random, .group_size = 1},
      "at least 2");
}

TEST(FrequencyGrid, RefusesWhatBreaksItsInvariant) {
  EXPECT_THROW(FrequencyGrid(100.0, 10, {}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(100.0, 10, {0, 1}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(100.0, 10, {1, 5}), std::invalid_argument);  // 5 is Nyquist
  EXPECT_NO_THROW(FrequencyGrid(100.0, 11, {1, 5}));                      // but below Nyquist here
  EXPECT_THROW(FrequencyGrid(100.0, 11, {1, 6}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(100.0, 10, {2, 2}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(100.0, 10, {3, 2}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(-1.0, 10, {1}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(kNan, 10, {1}), std::invalid_argument);
  EXPECT_THROW(FrequencyGrid(std::numeric_limits<double>::infinity(), 10, {1}),
               std::invalid_argument);
}

}  // namespace stageid::test_frequency_grid
