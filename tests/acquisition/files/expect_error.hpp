#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace stageid::test {

/// Expects `action` to throw an Error whose one-line message begins with `start` and contains `word`.
/// A template of the error alone: matchers take long to compile.
template <typename Error>
void expect_error(const std::function<void()>& action, const std::string& start,
                  const std::string& word) {
  using testing::AllOf, testing::HasSubstr, testing::Not, testing::StartsWith;
  EXPECT_THAT(action, testing::ThrowsMessage<Error>(
                          AllOf(StartsWith(start), HasSubstr(word), Not(HasSubstr("\n")))));
}

}  // namespace stageid::test
