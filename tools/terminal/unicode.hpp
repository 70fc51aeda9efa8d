#pragma once

#include <string>
#include <string_view>

namespace stageid {

/// UTF-8 to the UTF-16 of MATLAB and .npy headers, and back. What is not well-formed becomes U+FFFD.
std::u16string utf16_of(std::string_view text);
std::string utf8_of(std::u16string_view units);

/// Text of a file that does not say how it is encoded: well-formed UTF-8 stays, else each byte is a letter
/// of Latin-1, as older measurement programs write square and micro.
std::string utf8_of_text(std::string_view text);

/// UTF-8 to code points, and back, in the same way.
std::u32string code_points_of(std::string_view text);
std::string utf8_of(std::u32string_view points);

}  // namespace stageid
