#pragma once

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <complex>
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

/// Base64, then zlib. @throws std::invalid_argument
inline std::vector<std::uint8_t> unpacked(std::string_view text) {
  const std::vector<std::uint8_t> deflated = from_base64(text);
  std::vector<std::uint8_t> out;
  uLong read = 0, written = 0;
  int status = Z_BUF_ERROR;  // no room
  for (std::size_t size = 1 << 16; status == Z_BUF_ERROR && size < (1u << 28); size *= 4) {
    out.resize(size);
    read = deflated.size();
    written = size;
    status = uncompress2(out.data(), &written, deflated.data(), &read);
  }
  if (status != Z_OK || read != deflated.size())
    throw std::invalid_argument("zlib: not one whole stream");
  out.resize(written);
  return out;
}

/// Number i has its byte b at place b * count + i.
template <typename T>
std::vector<T> numbers_of_planes(const std::vector<std::uint8_t>& bytes) {
  if (bytes.size() % sizeof(T) != 0) throw std::invalid_argument("planes: not whole numbers");
  std::vector<T> out(bytes.size() / sizeof(T));
  for (std::size_t i = 0; i < out.size(); ++i) {
    std::uint8_t raw[sizeof(T)];
    for (std::size_t b = 0; b < sizeof(T); ++b) raw[b] = bytes[b * out.size() + i];
    std::memcpy(&out[i], raw, sizeof(T));
  }
  return out;
}

template <typename T>
std::vector<T> packed_numbers(std::string_view text) {
  return numbers_of_planes<T>(unpacked(text));
}

/// 0, -1, 1, -2, ... of 0, 1, 2, 3, ...
inline std::int64_t signed_of(std::uint32_t word) {
  const std::int64_t half = word / 2;
  return word % 2 == 0 ? half : -half - 1;
}

/// Rank of a finite float among all, negative for negative ones.
inline std::int64_t rank_of(float value) {
  std::int32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits >= 0 ? bits : std::int64_t{-1} - (bits & 0x7fffffff);
}

/// Ranks go round: after the last comes the first.
inline float float_of_rank(std::int64_t any) {
  const std::int64_t rank = static_cast<std::int32_t>(static_cast<std::uint32_t>(any));
  const std::uint32_t bits = rank >= 0 ? static_cast<std::uint32_t>(rank)
                                       : 0x80000000u | static_cast<std::uint32_t>(-1 - rank);
  float value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/// Expected value of a number from the previous ones; `order` as in the description of the page.
template <typename Number>
std::complex<double> expectation(const std::vector<Number>& values,
                                 const std::vector<std::complex<double>>& base, int order) {
  const auto excess = [&](std::size_t back) {
    if (values.size() < back) return std::complex<double>();
    const std::size_t i = values.size() - back;
    return std::complex<double>(values[i]) - (base.empty() ? 0.0 : base[i]);
  };
  const std::complex<double> own = base.empty() ? 0.0 : base[values.size()];
  if (order == 0) return own;
  return order == 1 ? own + excess(1) : own + (2.0 * excess(1) - excess(2));
}

constexpr double kLargestFloat = 3.4028234663852886e38;

/// Type c64 of the page.
inline std::vector<std::complex<double>> unpacked_float32(
    std::string_view text, int order = 0, const std::vector<std::complex<double>>& base = {}) {
  const auto words = packed_numbers<std::uint32_t>(text);
  std::vector<std::complex<double>> out;
  for (std::size_t i = 0; i + 1 < words.size(); i += 2) {
    const std::complex<double> guess = expectation(out, base, order);
    const auto part = [](double expected, std::uint32_t word) {
      const double near = std::min(kLargestFloat, std::max(-kLargestFloat, expected + 0.0));
      return static_cast<double>(
          float_of_rank(rank_of(static_cast<float>(near)) + signed_of(word)));
    };
    out.emplace_back(part(guess.real(), words[i]), part(guess.imag(), words[i + 1]));
  }
  return out;
}

/// Type c40 of the page.
inline std::vector<std::complex<double>> unpacked_block16(
    std::string_view text, int order = 0, const std::vector<std::complex<double>>& base = {}) {
  const std::vector<std::uint8_t> bytes = unpacked(text);
  const std::size_t count = bytes.size() / 5;
  const auto middle = bytes.begin() + 4 * count;
  const auto words = numbers_of_planes<std::uint16_t>({bytes.begin(), middle});
  std::vector<std::complex<double>> out;
  int exponent = 0;
  for (std::size_t i = 0; i < count; ++i) {
    exponent = static_cast<std::int8_t>(exponent + bytes[4 * count + i]);
    const std::complex<double> guess = expectation(out, base, order);
    const auto part = [exponent](double expected, std::uint32_t word) {
      const double scaled = std::floor(std::ldexp(expected, 15 - exponent) + 0.5);
      const double near = std::min(32767.0, std::max(-32767.0, scaled));
      const auto sum = static_cast<std::int64_t>(near) + signed_of(word);
      return std::ldexp(static_cast<double>(static_cast<std::int16_t>(sum)), exponent - 15);
    };
    out.emplace_back(part(guess.real(), words[2 * i]), part(guess.imag(), words[2 * i + 1]));
  }
  return out;
}

}  // namespace stageid::test
