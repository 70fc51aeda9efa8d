#include "tools/terminal/text_template.hpp"

#include <gtest/gtest.h>

namespace stageid::test_text_template {

TEST(FillTemplate, ReplacesKnownNamesOnceAndKeepsOtherText) {
  EXPECT_EQ(fill_template("", {{"a", "1"}}), "");
  EXPECT_EQ(fill_template("@a@@b@ a@a@b", {{"a", "1"}, {"b", "@a@"}}), "1@a@ a1b");
  EXPECT_EQ(fill_template("x @ y, @(f) @a@, @c@a@, @", {{"a", "1"}}), "x @ y, @(f) 1, @c1, @");
}

}  // namespace stageid::test_text_template
