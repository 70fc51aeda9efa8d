#include "estimation/fit/overlapping_modes.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/search/structure_moves.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_overlapping_modes {

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

AdditiveModel with_modes(const std::vector<std::pair<double, double>>& modes) {
  test::RandomNumbers random(1);
  return test::stage_2x3(HoldModel::none, random, modes).model;
}

// Half-power widths of 20 Hz at 1000 Hz: 15 and 5 Hz are less, 25 Hz is more. Submodel 0 is the rigid body.
TEST(OverlappingModes, TheNearestFirstAndNoneThatWasAskedFor) {
  EXPECT_EQ(overlapping_modes(with_modes({{1000.0, 0.01}, {1015.0, 0.001}, {1040.0, 0.001}})),
            (Pairs{{1, 2}}));
  EXPECT_EQ(overlapping_modes(with_modes({{1000.0, 0.01}, {1015.0, 0.01}, {1020.0, 0.01}})),
            (Pairs{{2, 3}, {1, 2}}));
  EXPECT_TRUE(overlapping_modes(with_modes({{500.0, 0.01}, {1000.0, 0.01}})).empty());
  AdditiveModel model = with_modes({{1000.0, 0.01}, {1001.0, 0.01}});
  model.submodels[1].role = SubmodelRole::given;
  EXPECT_TRUE(overlapping_modes(model).empty());
}

TEST(OverlappingModes, OneOfTwoIsTheirGeometricMean) {
  const AdditiveModel two = with_modes({{1000.0, 0.02}, {1020.0, 0.02}, {1500.0, 0.01}});
  const AdditiveModel one = with_one_of(two, 1, 2);
  ASSERT_EQ(one.submodels.size(), two.submodels.size() - 1);
  EXPECT_NEAR(one.submodels[1].natural_frequency_hz(), std::sqrt(1000.0 * 1020.0), 1e-9);
  EXPECT_NEAR(one.submodels[1].damping_ratio(), 0.02, 1e-12);
  EXPECT_NEAR(one.submodels[2].natural_frequency_hz(), 1500.0, 1e-9);
}

TEST(OverlappingModes, OfABroadAndANarrowOneTheNarrowOneIsKept) {
  for (const bool broad_first : {true, false}) {
    const AdditiveModel one = with_one_of(broad_first ? with_modes({{900.0, 0.3}, {1000.0, 0.01}})
                                                      : with_modes({{1000.0, 0.01}, {1100.0, 0.3}}),
                                          1, 2);
    EXPECT_NEAR(one.submodels[1].natural_frequency_hz(), 1000.0, 0.2);
    EXPECT_NEAR(one.submodels[1].damping_ratio(), 0.01, 1e-4);
  }
}

// A broad mode overlaps all of its neighbours. Each merge with one of them is the model without it.
TEST(OverlappingModes, ABroadModeIsMergedOnce) {
  const AdditiveModel model =
      with_modes({{900.0, 0.01}, {1000.0, 0.3}, {1100.0, 0.01}, {1105.0, 0.01}});
  EXPECT_EQ(overlapping_modes(model).size(), 4U);
  const std::vector<StructureMove> moves = merges({}, model);
  ASSERT_EQ(moves.size(), 2U);
  EXPECT_EQ(moves[0].flag, "merged 1000 and 1100 Hz");
  EXPECT_EQ(moves[1].flag, "merged 1100 and 1105 Hz");
}

}  // namespace stageid::test_overlapping_modes
