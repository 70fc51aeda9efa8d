#pragma once

#include <gtest/gtest.h>

#include <string>

namespace stageid::test {

/// Expects `action` to throw an Error whose one-line message begins with `start` and contains `word`.
template <typename Error, typename Action>
void expect_error(const Action& action, const std::string& start, const std::string& word) {
  try {
    action();
    ADD_FAILURE() << "no error; expected " << start << " ... " << word;
  } catch (const Error& e) {
    const std::string what = e.what();
    EXPECT_EQ(what.rfind(start, 0), 0U) << what << "\n  does not begin with " << start;
    EXPECT_NE(what.find(word), std::string::npos) << what << "\n  does not say " << word;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
}

}  // namespace stageid::test
