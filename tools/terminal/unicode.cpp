#include "tools/terminal/unicode.hpp"

#include <cstddef>

namespace stageid {
namespace {

constexpr char32_t kReplacement = 0xFFFD;

bool is_surrogate(char32_t point) { return point >= 0xD800 && point <= 0xDFFF; }

/// Reads the code point at `at` and moves `at` after it.
char32_t next_point(std::string_view text, std::size_t& at) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char first = byte(at++);
  if (first < 0x80) return first;
  const int more = first >= 0xF0 ? 3 : first >= 0xE0 ? 2 : first >= 0xC0 ? 1 : -1;
  if (more < 0) return kReplacement;
  char32_t point = first & (0x3FU >> more);
  for (int k = 0; k < more; ++k) {
    if (at >= text.size() || (byte(at) & 0xC0U) != 0x80U) return kReplacement;
    point = (point << 6U) | (byte(at++) & 0x3FU);
  }
  constexpr char32_t kLeast[] = {0, 0x80, 0x800, 0x10000};
  const bool valid = point >= kLeast[more] && point <= 0x10FFFF && !is_surrogate(point);
  return valid ? point : kReplacement;
}

void append(std::string& text, char32_t point) {
  if (point > 0x10FFFF || is_surrogate(point)) point = kReplacement;
  const auto put = [&](char32_t byte) {
    text += static_cast<char>(static_cast<unsigned char>(byte));
  };
  const auto tail = [&](unsigned shift) { put(0x80U | ((point >> shift) & 0x3FU)); };
  if (point < 0x80) {
    put(point);
  } else if (point < 0x800) {
    put(0xC0U | (point >> 6U));
    tail(0);
  } else if (point < 0x10000) {
    put(0xE0U | (point >> 12U));
    tail(6);
    tail(0);
  } else {
    put(0xF0U | (point >> 18U));
    tail(12);
    tail(6);
    tail(0);
  }
}

}  // namespace

std::u32string code_points_of(std::string_view text) {
  std::u32string points;
  for (std::size_t at = 0; at < text.size();) points += next_point(text, at);
  return points;
}

std::u16string utf16_of(std::string_view text) {
  std::u16string units;
  for (const char32_t point : code_points_of(text)) {
    if (point < 0x10000) {
      units += static_cast<char16_t>(point);
    } else {
      units += static_cast<char16_t>(0xD7C0 + (point >> 10U));
      units += static_cast<char16_t>(0xDC00 + (point & 0x3FFU));
    }
  }
  return units;
}

std::string utf8_of(std::u32string_view points) {
  std::string text;
  for (const char32_t point : points) append(text, point);
  return text;
}

std::string utf8_of(std::u16string_view units) {
  std::string text;
  for (std::size_t k = 0; k < units.size(); ++k) {
    const char32_t unit = units[k];
    const bool pair = unit >= 0xD800 && unit < 0xDC00 && k + 1 < units.size() &&
                      units[k + 1] >= 0xDC00 && units[k + 1] <= 0xDFFF;
    append(text, pair ? ((unit - 0xD7C0) << 10U) + (units[++k] - 0xDC00U) : unit);
  }
  return text;
}

std::string utf8_of_text(std::string_view text) {
  if (utf8_of(code_points_of(text)) == text) return std::string(text);
  std::string latin_1;
  for (const char c : text) append(latin_1, static_cast<unsigned char>(c));
  return latin_1;
}

}  // namespace stageid
