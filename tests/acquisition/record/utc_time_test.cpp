#include "acquisition/record/utc_time.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <ctime>

namespace stageid::test_utc_time {

std::time_t parsed(const std::string& text) {
  std::tm time{};
  const char* end = strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &time);
  EXPECT_NE(end, nullptr) << text;
  return timegm(&time);
}

TEST(UtcTime, IsTheSameInEveryTimeZone) {
  setenv("TZ", "Asia/Kolkata", 1);
  tzset();
  const std::time_t before = std::time(nullptr);
  const std::string seconds = utc_now();
  const std::string milliseconds = utc_now_ms();
  const std::time_t after = std::time(nullptr);
  unsetenv("TZ");
  tzset();
  EXPECT_EQ(seconds.size(), 20U);
  EXPECT_EQ(seconds.back(), 'Z');
  EXPECT_EQ(milliseconds.size(), 24U);
  EXPECT_EQ(milliseconds[19], '.');
  for (const std::string& text : {seconds, milliseconds}) {
    EXPECT_GE(parsed(text), before);
    EXPECT_LE(parsed(text), after);
  }
}

}  // namespace stageid::test_utc_time
