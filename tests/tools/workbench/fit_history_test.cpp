#include "tools/workbench/fit_history.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace stageid::test_fit_history {

FitState named(const std::string& what) {
  FitState state;
  state.what = what;
  return state;
}

TEST(FitHistory, UndoAndRedoWalkAndAPushForgetsTheUndone) {
  FitHistory history(named("opened"));
  EXPECT_FALSE(history.undo());
  history.push(named("a"));
  history.push(named("b"));
  EXPECT_TRUE(history.undo());
  EXPECT_EQ(history.current().what, "a");
  EXPECT_TRUE(history.redo());
  EXPECT_EQ(history.current().what, "b");
  EXPECT_FALSE(history.redo());
  EXPECT_TRUE(history.go(0));
  history.push(named("c"));
  ASSERT_EQ(history.states().size(), 2U);
  EXPECT_EQ(history.current().what, "c");
  EXPECT_FALSE(history.go(2));
}

TEST(FitHistory, KeepsTheFirstAndTheNewest) {
  FitHistory history(named("opened"));
  const std::size_t pushed = FitHistory::kMost + 5;
  for (std::size_t i = 0; i < pushed; ++i) history.push(named(fmt::format("{}", i)));
  ASSERT_EQ(history.states().size(), FitHistory::kMost);
  EXPECT_EQ(history.states().front().what, "opened");
  EXPECT_EQ(history.current().what, fmt::format("{}", pushed - 1));
  EXPECT_EQ(history.index(), FitHistory::kMost - 1);
}

}  // namespace stageid::test_fit_history
