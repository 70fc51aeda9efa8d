#include "tools/terminal/unicode.hpp"

#include <utf8.h>

namespace stageid {
namespace {

constexpr char16_t kReplacement = 0xFFFD;

bool is_surrogate(char32_t point) { return point >= 0xD800 && point <= 0xDFFF; }

void append(std::string& text, char32_t point) {
  if (point > 0x10FFFF || is_surrogate(point)) point = kReplacement;
  utf8::append(point, text);
}

}  // namespace

std::u32string code_points_of(std::string_view text) {
  return utf8::utf8to32(utf8::replace_invalid(text));
}

std::u16string utf16_of(std::string_view text) {
  return utf8::utf8to16(utf8::replace_invalid(text));
}

std::string utf8_of(std::u32string_view points) {
  std::string text;
  for (const char32_t point : points) append(text, point);
  return text;
}

std::string utf8_of(std::u16string_view units) {
  std::u16string paired(units);
  for (std::size_t k = 0; k < paired.size(); ++k) {
    if (!is_surrogate(paired[k])) continue;
    const char16_t next = k + 1 < paired.size() ? paired[k + 1] : u'\0';
    if (paired[k] < 0xDC00 && next >= 0xDC00 && is_surrogate(next))
      ++k;
    else
      paired[k] = kReplacement;
  }
  return utf8::utf16to8(paired);
}

std::string utf8_of_text(std::string_view text) {
  if (utf8::is_valid(text)) return std::string(text);
  std::string latin_1;
  for (const char c : text) append(latin_1, static_cast<unsigned char>(c));
  return latin_1;
}

}  // namespace stageid
