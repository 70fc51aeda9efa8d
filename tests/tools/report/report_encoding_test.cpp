#include "tools/report/report_encoding.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <vector>

#include "tests/tools/report/packed_reader.hpp"

namespace stageid::report {
namespace test_report_encoding {

using test::packed_numbers;
using test::unpacked;
using test::unpacked_block16;
using test::unpacked_float32;

std::vector<std::uint8_t> bytes(const std::string& text) { return {text.begin(), text.end()}; }

TEST(ReportEncoding, Base64HasTheVectorsOfRfc4648) {
  EXPECT_EQ(base64(bytes("")), "");
  EXPECT_EQ(base64(bytes("f")), "Zg==");
  EXPECT_EQ(base64(bytes("fo")), "Zm8=");
  EXPECT_EQ(base64(bytes("foo")), "Zm9v");
  EXPECT_EQ(base64(bytes("foob")), "Zm9vYg==");
  EXPECT_EQ(base64(bytes("fooba")), "Zm9vYmE=");
  EXPECT_EQ(base64(bytes("foobar")), "Zm9vYmFy");
  const std::vector<std::uint8_t> high = {0xff, 0xef, 0xbe};
  EXPECT_EQ(base64(high), "/+++");
}

TEST(ReportEncoding, UnpacksToTheSameBytes) {
  std::vector<std::uint8_t> many;
  for (std::uint32_t i = 0, x = 1; i < 100'000; ++i, x = x * 1664525u + 1013904223u)
    many.push_back(static_cast<std::uint8_t>(i % 3 == 0 ? 7 : x >> 24));
  for (const std::vector<std::uint8_t>& raw : {many, bytes("a"), bytes("")})
    EXPECT_EQ(test::unpacked(packed(raw)), raw);
  // Of three bytes one is known, which costs a bit or so.
  EXPECT_LT(packed(many).size(), base64(many).size() * 8 / 10);
}

TEST(ReportEncoding, BytesOfTheSamePlaceStandTogether) {
  const std::vector<std::uint16_t> numbers = {0x0102, 0x0304, 0x0506};
  EXPECT_EQ(byte_planes(numbers), (std::vector<std::uint8_t>{2, 4, 6, 1, 3, 5}));
  EXPECT_EQ(test::numbers_of_planes<std::uint16_t>(byte_planes(numbers)), numbers);
}

TEST(ReportEncoding, FloatsStandChannelAfterChannel) {
  Eigen::MatrixXd values(2, 3);
  values << 1.0, -2.5, 1e-12, 0.1, 3e30, 0.0;
  const std::vector<float> expected = {1.0F, -2.5F, 1e-12F, 0.1F, 3e30F, 0.0F};
  EXPECT_EQ(packed_numbers<float>(encode_float32(values)), expected);
}

TEST(ReportEncoding, ComplexFloatsAreRealThenImaginary) {
  Eigen::MatrixXcd values(1, 2);
  values << std::complex<double>(1.0, 2.0), std::complex<double>(-3.0, 0.25);
  const std::vector<std::complex<double>> expected = {{1.0, 2.0}, {-3.0, 0.25}};
  EXPECT_EQ(unpacked_float32(encode_complex_float32(values).text), expected);
}

TEST(ReportEncoding, DoublesAreExact) {
  const Eigen::VectorXd values{{0.1, 1e300, -1.0 / 3.0}};
  EXPECT_EQ(packed_numbers<double>(encode_float64(values)),
            std::vector<double>(values.begin(), values.end()));
}

TEST(ReportEncoding, FiveBytesKeepEachPartToTheStatedShareOfTheLarger) {
  std::vector<std::complex<double>> values;
  for (int i = 0; i < 4000; ++i) {
    const double size = std::pow(10.0, -30.0 + 0.015 * i);  // 1e-30 to 1e30
    values.push_back(std::polar(size, 0.7 * i));
  }
  // Rounding up at the edge of an exponent must not leave int16.
  values.emplace_back(1.0 - 1e-9, -(1.0 - 1e-9));
  values.emplace_back(-(1.0 - 1e-9), 0.0);
  values.emplace_back(0.0, 0.0);
  const Eigen::MatrixXcd matrix =
      Eigen::Map<Eigen::RowVectorXcd>(values.data(), std::ssize(values));
  const auto decoded = unpacked_block16(encode_complex_block16(matrix).text);
  ASSERT_EQ(decoded.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double larger = std::max(std::abs(values[i].real()), std::abs(values[i].imag()));
    EXPECT_LE(std::abs(decoded[i].real() - values[i].real()), std::ldexp(larger, -15)) << i;
    EXPECT_LE(std::abs(decoded[i].imag() - values[i].imag()), std::ldexp(larger, -15)) << i;
  }
}

TEST(ReportEncoding, WhatIsTooSmallForFiveBytesIsZeroAndWhatIsTooLargeIsTheLargest) {
  Eigen::MatrixXcd values(1, 2);
  values << 1e-60, 1e60;
  const auto decoded = unpacked_block16(encode_complex_block16(values).text);
  EXPECT_EQ(decoded[0], 0.0);
  EXPECT_EQ(decoded[1].real(), std::ldexp(32767.0, 127 - 15));
}

/// A curve, noise on it of the size `relative`, and numbers that no curve leads to.
Eigen::MatrixXcd noisy(double relative) {
  Eigen::MatrixXcd out(3, 400);
  for (Eigen::Index row = 0; row < out.rows(); ++row)
    for (Eigen::Index k = 0; k < out.cols(); ++k) {
      const auto x = static_cast<double>(k + 1);
      const double size = std::pow(x, -2.0 * static_cast<double>(row)) * 1e-3;
      out(row, k) = std::polar(size, 0.01 * x) + relative * size * std::polar(1.0, x * x);
    }
  out(0, 7) = 0.0;
  out(0, 8) = std::complex<double>(-0.0, 3e38);
  out(0, 9) = std::complex<double>(-3e38, -3e38);
  out(0, 10) = std::complex<double>(1e-44, -1e-46);  // below the normal float32, and below all
  out(1, 11) = std::complex<double>(1e60, -1e60);
  return out;
}

std::vector<std::complex<double>> by_channels(const Eigen::MatrixXcd& values) {
  std::vector<std::complex<double>> out;
  for (Eigen::Index row = 0; row < values.rows(); ++row)
    out.insert(out.end(), values.row(row).begin(), values.row(row).end());
  return out;
}

TEST(ReportEncoding, NoExpectationChangesANumber) {
  const Eigen::MatrixXcd values = noisy(0.1);
  const ComplexCode base = encode_complex_block16(noisy(0.3));
  const std::vector<std::complex<double>> based = by_channels(base.decoded);
  const std::vector<std::complex<double>> plain32 =
      unpacked_float32(encode_complex_float32(values).text);
  const std::vector<std::complex<double>> plain16 =
      unpacked_block16(encode_complex_block16(values).text);
  ASSERT_EQ(plain32.size(), 1200u);
  constexpr double most = std::numeric_limits<float>::max();
  for (std::size_t i = 0; i < plain32.size(); ++i) {
    const std::complex<double> value = by_channels(values)[i];
    EXPECT_EQ(plain32[i].real(), static_cast<float>(std::clamp(value.real(), -most, most))) << i;
    EXPECT_EQ(plain32[i].imag(), static_cast<float>(std::clamp(value.imag(), -most, most))) << i;
    EXPECT_EQ(std::signbit(plain32[i].real()), std::signbit(value.real())) << i;
  }
  for (const int order : {0, 1, 2}) {
    for (const bool with_base : {false, true}) {
      const Expectation expected{with_base ? &base.decoded : nullptr, order};
      const auto known = with_base ? based : std::vector<std::complex<double>>();
      const ComplexCode code32 = encode_complex_float32(values, expected);
      EXPECT_EQ(unpacked_float32(code32.text, order, known), plain32) << order << with_base;
      EXPECT_EQ(by_channels(code32.decoded), plain32);
      const ComplexCode code16 = encode_complex_block16(values, expected);
      EXPECT_EQ(unpacked_block16(code16.text, order, known), plain16) << order << with_base;
      EXPECT_EQ(by_channels(code16.decoded), plain16);
    }
  }
}

TEST(ReportEncoding, WhatIsExpectedTakesNoSpace) {
  const Eigen::MatrixXcd smooth = noisy(0.0).middleCols(20, 380);
  const std::size_t raw = encode_complex_block16(smooth).text.size();
  EXPECT_LT(2 * encode_complex_block16(smooth, {nullptr, 2}).text.size(), raw);
  const ComplexCode same = encode_complex_block16(smooth);
  EXPECT_LT(10 * encode_complex_block16(smooth, {&same.decoded, 0}).text.size(), raw);
}

TEST(ReportEncoding, LogBytesKeepEveryRowToHalfItsStep) {
  Eigen::MatrixXd values(3, 500);
  for (Eigen::Index k = 0; k < 500; ++k) {
    values(0, k) = std::pow(10.0, -4.0 - 0.016 * static_cast<double>(k));  // eight decades
    values(1, k) = 2.0 + std::sin(static_cast<double>(k));
    values(2, k) = 7e-9;  // no range at all
  }
  values(1, 77) = 0.0;
  const LogBytes encoded = encode_log_bytes(values);
  std::vector<std::uint8_t> codes = unpacked(encoded.text);
  for (std::size_t i = 1; i < codes.size(); ++i)
    codes[i] = static_cast<std::uint8_t>(codes[i] + codes[i - 1]);
  ASSERT_EQ(codes.size(), 1500u);
  for (Eigen::Index row = 0; row < 3; ++row) {
    const auto r = static_cast<std::size_t>(row);
    for (Eigen::Index k = 0; k < 500; ++k) {
      const std::uint8_t code = codes[500 * r + static_cast<std::size_t>(k)];
      if (values(row, k) == 0.0) {
        EXPECT_EQ(code, 0);
        continue;
      }
      ASSERT_GE(code, 1);
      const double decoded = std::exp2(encoded.low[r] + (code - 1) * encoded.step[r]);
      // Half a step, and the rounding of the exponent itself: |log2| < 64, times eps ln 2.
      EXPECT_LE(std::abs(std::log2(decoded / values(row, k))), 0.5 * encoded.step[r] + 1e-13);
    }
  }
}

}  // namespace test_report_encoding
}  // namespace stageid::report
