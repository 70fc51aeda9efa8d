#include "hal/stage/stage.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <utility>

namespace stageid::test_stage {

TEST(Outcome, HasANameOfItsOwn) {
  std::set<std::string> names;
  for (int i = 0; i <= static_cast<int>(Outcome::limit); ++i)
    names.insert(to_string(static_cast<Outcome>(i)));
  EXPECT_EQ(names.size(), 10U);
  EXPECT_EQ(names.count("unknown outcome"), 0U);
  EXPECT_STREQ(to_string(static_cast<Outcome>(200)), "unknown outcome");
}

TEST(NodeState, HasANameOfItsOwn) {
  std::set<std::string> names;
  for (int i = 0; i <= static_cast<int>(NodeState::fault); ++i)
    names.insert(to_string(static_cast<NodeState>(i)));
  EXPECT_EQ(names.size(), 9U);
  EXPECT_EQ(names.count("unknown state"), 0U);
  EXPECT_STREQ(to_string(static_cast<NodeState>(200)), "unknown state");
}

TEST(Stage, ValuesAreFiniteIfAllAre) {
  const double infinite = std::numeric_limits<double>::infinity();
  std::vector<double> values = {1e308, -1e308, 0.0, -0.0, 5e-324};
  EXPECT_TRUE(all_finite({}));
  EXPECT_TRUE(all_finite(values));
  for (const double bad : {infinite, -infinite, std::nan("")})
    for (double& value : values) {
      const double good = std::exchange(value, bad);
      EXPECT_FALSE(all_finite(values)) << bad;
      value = good;
    }
}

}  // namespace stageid::test_stage
