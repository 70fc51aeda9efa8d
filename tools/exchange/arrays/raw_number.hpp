#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <string>

namespace stageid {

/// The number whose bytes are at `at`, which need not be aligned.
template <typename Number>
Number raw_number(const void* at, bool big_endian = false) {
  char raw[sizeof(Number)];
  std::memcpy(raw, at, sizeof(raw));
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(raw, raw + sizeof(raw));
  Number number;
  std::memcpy(&number, raw, sizeof(raw));
  return number;
}

/// Reads a number of some type as double.
struct NumberType {
  std::size_t width;
  double (*read)(const void* at, bool big_endian);
};
template <typename Number>
inline constexpr NumberType kNumberType = {
    sizeof(Number), [](const void* at, bool big_endian) {
      return static_cast<double>(raw_number<Number>(at, big_endian));
    }};

/// Appends a number as it is in memory.
template <typename Number>
void append_raw(std::string& bytes, Number number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

}  // namespace stageid
