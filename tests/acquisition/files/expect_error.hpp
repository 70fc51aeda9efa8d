#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace stageid::test {

/// Expects `action` to throw an Error whose one-line message begins with `start` and contains `word`.
template <typename Error, typename Action>
void expect_error(const Action& action, const std::string& start, const std::string& word) {
  using testing::AllOf, testing::HasSubstr, testing::Not, testing::StartsWith;
  EXPECT_THAT(action, testing::ThrowsMessage<Error>(
                          AllOf(StartsWith(start), HasSubstr(word), Not(HasSubstr("\n")))));
}

}  // namespace stageid::test
