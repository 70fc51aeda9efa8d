#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace stageid::test {

/// RFC 4648, written apart from the encoder under test. @throws std::invalid_argument
inline std::vector<std::uint8_t> from_base64(std::string_view text) {
  static const std::string alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  if (text.size() % 4 != 0) throw std::invalid_argument("base64: length");
  std::vector<std::uint8_t> out;
  std::uint32_t bits = 0;
  int there = 0;
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  for (const char c : text) {
    const std::size_t digit = alphabet.find(c);
    if (digit == std::string::npos) throw std::invalid_argument("base64: digit");
    bits = (bits << 6) | static_cast<std::uint32_t>(digit);
    there += 6;
    if (there < 8) continue;
    there -= 8;
    out.push_back(static_cast<std::uint8_t>(bits >> there));
  }
  return out;
}

template <typename T>
std::vector<T> numbers_from_base64(std::string_view text) {
  const std::vector<std::uint8_t> bytes = from_base64(text);
  if (bytes.size() % sizeof(T) != 0) throw std::invalid_argument("base64: not whole numbers");
  std::vector<T> out(bytes.size() / sizeof(T));
  if (!bytes.empty()) std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

}  // namespace stageid::test
