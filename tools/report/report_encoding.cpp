#include "tools/report/report_encoding.hpp"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <limits>
#include <new>
#include <utility>

namespace stageid::report {

static_assert(std::endian::native == std::endian::little, "the page expects little-endian numbers");

namespace {

template <typename T>
std::string packed_planes(const std::vector<T>& values) {
  return packed(byte_planes(values));
}

/// Encodes numbers one after another, each with the value expected from those before. `encode(number, expected)` returns
/// the number as the page decodes it. @returns the decoded numbers
template <typename Encode>
Eigen::MatrixXcd encode_each(const Eigen::MatrixXcd& values, const Expectation& expected,
                             Encode encode) {
  Eigen::MatrixXcd decoded(values.rows(), values.cols());
  std::complex<double> last = 0.0, before = 0.0;
  for (Eigen::Index row = 0; row < values.rows(); ++row)
    for (Eigen::Index k = 0; k < values.cols(); ++k) {
      const std::complex<double> base = expected.base != nullptr ? (*expected.base)(row, k) : 0.0;
      std::complex<double> guess = base;
      if (expected.order > 0) guess += expected.order == 1 ? last : 2.0 * last - before;
      decoded(row, k) = encode(values(row, k), guess);
      before = last;
      last = decoded(row, k) - base;
    }
  return decoded;
}

float to_float(double value) {
  constexpr auto most = static_cast<double>(std::numeric_limits<float>::max());
  return static_cast<float>(std::clamp(value, -most, most));
}

/// Index in the order of all float32, -0 just before 0.
std::uint32_t place_of(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits >> 31) != 0 ? ~bits : bits | 0x80000000u;
}

std::uint32_t sign_last(std::int32_t value) {
  return (static_cast<std::uint32_t>(value) << 1) ^ static_cast<std::uint32_t>(value >> 31);
}

std::uint16_t sign_last(std::int16_t value) {
  return static_cast<std::uint16_t>(sign_last(std::int32_t{value}));
}

/// One complex number as two mantissas under one exponent.
struct Block16 {
  std::int16_t re = 0;
  std::int16_t im = 0;
  int exponent = 0;  // -127 to 127
};

Block16 to_block16(std::complex<double> value) {
  const double largest = std::max(std::abs(value.real()), std::abs(value.imag()));
  if (largest == 0.0) return {};
  int exponent = 0;
  std::frexp(largest, &exponent);  // largest = f 2^exponent, 0.5 <= f < 1
  if (std::lround(std::ldexp(largest, 15 - exponent)) > std::numeric_limits<std::int16_t>::max())
    ++exponent;  // 0.99999 would round to 32768
  exponent = std::clamp(exponent, -127, 127);
  const auto mantissa = [exponent](double part) {
    const double scaled = std::clamp(std::ldexp(part, 15 - exponent), -32767.0, 32767.0);
    return static_cast<std::int16_t>(std::lround(scaled));
  };
  return {mantissa(value.real()), mantissa(value.imag()), exponent};
}

std::complex<double> value_of(const Block16& block) {
  const int power = block.exponent - 15;
  return {std::ldexp(block.re, power), std::ldexp(block.im, power)};
}

/// The mantissa minus the expected one, with the rounding of the page: halves up.
std::uint16_t mantissa_code(std::int16_t mantissa, double expected, int exponent) {
  const double scaled = std::floor(std::ldexp(expected, 15 - exponent) + 0.5);
  const auto guess = static_cast<std::int32_t>(std::clamp(scaled, -32767.0, 32767.0));
  return sign_last(static_cast<std::int16_t>(mantissa - guess));
}

}  // namespace

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr char alphabet[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t there = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = std::uint32_t{bytes[i]} << 16;
    if (there > 1) word |= std::uint32_t{bytes[i + 1]} << 8;
    if (there > 2) word |= std::uint32_t{bytes[i + 2]};
    for (std::size_t j = 0; j < 4; ++j)
      text += j <= there ? alphabet[(word >> (18 - 6 * j)) & 63] : '=';
  }
  return text;
}

std::string packed(std::span<const std::uint8_t> bytes, int level) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::vector<std::uint8_t> out(size);
  // With the bound as size, only memory allocation can fail.
  if (compress2(out.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), level) != Z_OK)
    throw std::bad_alloc();
  return base64({out.data(), size});
}

std::string encode_float64(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return packed_planes(std::vector<double>(values.begin(), values.end()));
}

std::string encode_float32(const Eigen::Ref<const Eigen::MatrixXd>& values) {
  std::vector<float> out;
  out.reserve(values.size());
  for (Eigen::Index row = 0; row < values.rows(); ++row)
    for (const double value : values.row(row)) out.push_back(static_cast<float>(value));
  return packed_planes(out);
}

ComplexCode encode_complex_float32(const Eigen::MatrixXcd& values, Expectation expected) {
  std::vector<std::uint32_t> words;
  words.reserve(2 * static_cast<std::size_t>(values.size()));
  const auto encode = [&words](double part, double guess) {
    const float value = to_float(part);
    const std::uint32_t expected_place = place_of(to_float(guess + 0.0));  // -0 is expected as 0
    words.push_back(sign_last(static_cast<std::int32_t>(place_of(value) - expected_place)));
    return static_cast<double>(value);
  };
  Eigen::MatrixXcd decoded =
      encode_each(values, expected, [&](std::complex<double> value, std::complex<double> guess) {
        const double re = encode(value.real(), guess.real());
        return std::complex(re, encode(value.imag(), guess.imag()));
      });
  return {packed_planes(words), std::move(decoded)};
}

ComplexCode encode_complex_block16(const Eigen::MatrixXcd& values, Expectation expected) {
  std::vector<std::uint16_t> mantissas;
  std::vector<std::uint8_t> exponents;
  mantissas.reserve(2 * static_cast<std::size_t>(values.size()));
  exponents.reserve(values.size());
  int before = 0;
  Eigen::MatrixXcd decoded =
      encode_each(values, expected, [&](std::complex<double> value, std::complex<double> guess) {
        const Block16 block = to_block16(value);
        mantissas.push_back(mantissa_code(block.re, guess.real(), block.exponent));
        mantissas.push_back(mantissa_code(block.im, guess.imag(), block.exponent));
        exponents.push_back(static_cast<std::uint8_t>(block.exponent - before));
        before = block.exponent;
        return value_of(block);
      });
  std::vector<std::uint8_t> bytes = byte_planes(mantissas);
  bytes.insert(bytes.end(), exponents.begin(), exponents.end());
  return {packed(bytes), std::move(decoded)};
}

LogBytes encode_log_bytes(const Eigen::Ref<const Eigen::MatrixXd>& values) {
  LogBytes out;
  std::vector<std::uint8_t> codes;
  codes.reserve(values.size());
  std::uint8_t before = 0;
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const double value : values.row(row)) {
      if (value <= 0.0) continue;
      low = std::min(low, std::log2(value));
      high = std::max(high, std::log2(value));
    }
    if (low > high) low = high = 0.0;  // nothing positive in this row
    const double step = (high - low) / 254.0;
    for (const double value : values.row(row)) {
      const double place = value > 0.0 && step > 0.0 ? (std::log2(value) - low) / step : 0.0;
      const auto code = static_cast<std::uint8_t>(value > 0.0 ? 1 + std::lround(place) : 0);
      codes.push_back(static_cast<std::uint8_t>(code - before));
      before = code;
    }
    out.low.push_back(low);
    out.step.push_back(step);
  }
  out.text = packed(codes);
  return out;
}

}  // namespace stageid::report
