#include "tools/report_encoding.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace stageid::report {
namespace {

static_assert(std::endian::native == std::endian::little, "the page expects little-endian numbers");

template <typename T>
std::string base64_of(const std::vector<T>& values) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
  return base64({bytes, values.size() * sizeof(T)});
}

/// One complex number as two mantissas under one exponent.
struct Block16 {
  std::int16_t re = 0;
  std::int16_t im = 0;
  std::int8_t exponent = 0;
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
  return {mantissa(value.real()), mantissa(value.imag()), static_cast<std::int8_t>(exponent)};
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

std::string encode_float64(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return base64_of(std::vector<double>(values.begin(), values.end()));
}

std::string encode_float32(const Eigen::Ref<const Eigen::MatrixXd>& values) {
  std::vector<float> out;
  out.reserve(static_cast<std::size_t>(values.size()));
  for (Eigen::Index row = 0; row < values.rows(); ++row)
    for (const double value : values.row(row)) out.push_back(static_cast<float>(value));
  return base64_of(out);
}

std::string encode_complex_float32(const Eigen::Ref<const Eigen::MatrixXcd>& values) {
  std::vector<float> out;
  out.reserve(2 * static_cast<std::size_t>(values.size()));
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    for (const std::complex<double> value : values.row(row)) {
      out.push_back(static_cast<float>(value.real()));
      out.push_back(static_cast<float>(value.imag()));
    }
  }
  return base64_of(out);
}

std::string encode_complex_block16(const Eigen::Ref<const Eigen::MatrixXcd>& values) {
  const auto count = static_cast<std::size_t>(values.size());
  std::vector<std::int16_t> mantissas;
  std::vector<std::int8_t> exponents;
  mantissas.reserve(2 * count);
  exponents.reserve(count);
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    for (const std::complex<double> value : values.row(row)) {
      const Block16 block = to_block16(value);
      mantissas.insert(mantissas.end(), {block.re, block.im});
      exponents.push_back(block.exponent);
    }
  }
  std::vector<std::uint8_t> bytes(5 * count);
  if (count > 0) {
    std::memcpy(bytes.data(), mantissas.data(), 4 * count);
    std::memcpy(bytes.data() + 4 * count, exponents.data(), count);
  }
  return base64(bytes);
}

LogBytes encode_log_bytes(const Eigen::Ref<const Eigen::MatrixXd>& values) {
  LogBytes out;
  std::vector<std::uint8_t> codes;
  codes.reserve(static_cast<std::size_t>(values.size()));
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
      codes.push_back(value > 0.0 ? static_cast<std::uint8_t>(1 + std::lround(place)) : 0);
    }
    out.low.push_back(low);
    out.step.push_back(step);
  }
  out.text = base64(codes);
  return out;
}

}  // namespace stageid::report
