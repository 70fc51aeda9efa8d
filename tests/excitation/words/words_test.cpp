#include "excitation/words/words.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>

namespace stageid {
namespace words_test {

enum class Weather : std::int8_t { sun, light_rain, snow };

}  // namespace words_test

template <>
inline constexpr std::array kWords<words_test::Weather> = {"sun", "light rain", "snow"};

namespace words_test {
namespace {

enum class Silent : std::uint8_t { one };
static_assert(!HasWords<Silent> && !HasWords<int> && HasWords<Weather>);

TEST(WordsTest, EveryValueHasItsWordAndIsFoundByIt) {
  EXPECT_STREQ(to_string(Weather::light_rain), "light rain");
  for (const Weather value : {Weather::sun, Weather::light_rain, Weather::snow})
    EXPECT_EQ(from_word<Weather>(to_string(value)), value);
}

TEST(WordsTest, ValuesOutsideTheTableAreUnknown) {
  EXPECT_STREQ(to_string(static_cast<Weather>(3)), "unknown");
  EXPECT_STREQ(to_string(static_cast<Weather>(127)), "unknown");
  EXPECT_STREQ(to_string(static_cast<Weather>(-1)), "unknown");
  EXPECT_STREQ(word_at(kWords<Weather>, 3, "none of these"), "none of these");
}

TEST(WordsTest, OnlyWholeWordsAreFound) {
  for (const char* word : {"", "su", "sunny", "Sun", "unknown"})
    EXPECT_FALSE(from_word<Weather>(word)) << word;
}

TEST(WordsTest, ListsItsWordsInOrder) {
  EXPECT_THAT(words_of<Weather>(), testing::ElementsAre("sun", "light rain", "snow"));
  EXPECT_THAT(words_before(Weather::snow), testing::ElementsAre("sun", "light rain"));
  EXPECT_THAT(words_before(Weather::sun), testing::IsEmpty());
}

TEST(WordsTest, NamesTheChoicesInASentence) {
  EXPECT_EQ(one_of(kWords<Weather>), "sun, light rain or snow");
  EXPECT_EQ(one_of(kWords<Weather>, "'"), "'sun', 'light rain' or 'snow'");
  EXPECT_EQ(one_of(std::array{"sun", "snow"}), "sun or snow");
  EXPECT_EQ(one_of(std::array{"sun"}), "sun");
}

}  // namespace
}  // namespace words_test
}  // namespace stageid
