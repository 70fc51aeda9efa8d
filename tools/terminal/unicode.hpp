#pragma once

#include <string>
#include <string_view>

namespace stageid {

/// Converts UTF-8 to UTF-16, as in MATLAB and .npy headers, and back. Invalid sequences become U+FFFD.
std::u16string utf16_of(std::string_view text);
std::string utf8_of(std::u16string_view units);

/// Converts text of a file with unknown encoding: well-formed UTF-8 is unchanged, otherwise the text is Latin-1, which
/// older measurement programs use for superscript two and micro.
std::string utf8_of_text(std::string_view text);

/// Converts UTF-8 to code points and back in the same way.
std::u32string code_points_of(std::string_view text);
std::string utf8_of(std::u32string_view points);

}  // namespace stageid
