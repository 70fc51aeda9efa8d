#include "tools/terminal/unicode.hpp"

#include <gtest/gtest.h>

namespace stageid::test_unicode {

TEST(Unicode, EncodingsHoldTheSameText) {
  const std::string text = "a\xC2\xB5\xE2\x82\xAC\xF0\x9F\x98\x80";  // one to four bytes
  EXPECT_EQ(code_points_of(text), U"a\u00B5\u20AC\U0001F600");
  EXPECT_EQ(utf16_of(text), u"a\u00B5\u20AC\U0001F600");
  EXPECT_EQ(utf8_of(code_points_of(text)), text);
  EXPECT_EQ(utf8_of(utf16_of(text)), text);
}

TEST(Unicode, MalformedUtf8BecomesReplacementCharacters) {
  EXPECT_EQ(code_points_of("a\xE9z"), U"a\uFFFDz");
  EXPECT_EQ(code_points_of("a\xE2\x82"), U"a\uFFFD");          // truncated
  EXPECT_EQ(code_points_of("\xC0\x80z"), U"\uFFFDz");          // overlong
  EXPECT_EQ(code_points_of("\xED\xA0\x80z"), U"\uFFFDz");      // surrogate
  EXPECT_EQ(code_points_of("\xF4\x90\x80\x80z"), U"\uFFFDz");  // beyond Unicode
  EXPECT_EQ(utf16_of("\x80z"), u"\uFFFDz");
}

TEST(Unicode, NumbersThatAreNotCharactersBecomeReplacementCharacters) {
  const char32_t points[] = {U'a', 0xD800, 0x110000, 0xFFFFFFFF, U'z'};
  EXPECT_EQ(utf8_of(std::u32string_view(points, 5)), "a\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBDz");
  const char16_t lone[] = {0xDC00, u'a', 0xD83D, u'z', 0xD83D, 0xD83D, 0xDE00, 0xD83D};
  EXPECT_EQ(utf8_of(std::u16string_view(lone, 8)),
            "\xEF\xBF\xBD"
            "a"
            "\xEF\xBF\xBDz\xEF\xBF\xBD\xF0\x9F\x98\x80\xEF\xBF\xBD");
}

TEST(Unicode, TextThatIsNotUtf8IsLatin1) {
  EXPECT_EQ(utf8_of_text("\xC2\xB5m"), "\xC2\xB5m");
  EXPECT_EQ(utf8_of_text("\xB5m"), "\xC2\xB5m");
  EXPECT_EQ(utf8_of_text("m/s\xB2 \xC2\xB5"), "m/s\xC2\xB2 \xC3\x82\xC2\xB5");
}

}  // namespace stageid::test_unicode
