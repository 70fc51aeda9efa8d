#include "tools/report_encoding.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstring>
#include <string>
#include <vector>

#include "tests/tools/report/base64_reader.hpp"

namespace stageid::report {
namespace {

using test::from_base64;
using test::numbers_from_base64;

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

TEST(ReportEncoding, FloatsStandChannelAfterChannel) {
  Eigen::MatrixXd values(2, 3);
  values << 1.0, -2.5, 1e-12, 0.1, 3e30, 0.0;
  const std::vector<float> expected = {1.0F, -2.5F, 1e-12F, 0.1F, 3e30F, 0.0F};
  EXPECT_EQ(numbers_from_base64<float>(encode_float32(values)), expected);
}

TEST(ReportEncoding, ComplexFloatsAreRealThenImaginary) {
  Eigen::MatrixXcd values(1, 2);
  values << std::complex<double>(1.0, 2.0), std::complex<double>(-3.0, 0.25);
  const std::vector<float> expected = {1.0F, 2.0F, -3.0F, 0.25F};
  EXPECT_EQ(numbers_from_base64<float>(encode_complex_float32(values)), expected);
}

TEST(ReportEncoding, DoublesAreExact) {
  const Eigen::VectorXd values{{0.1, 1e300, -1.0 / 3.0}};
  EXPECT_EQ(numbers_from_base64<double>(encode_float64(values)),
            std::vector<double>(values.begin(), values.end()));
}

/// As fromBlock16() of the page.
std::vector<std::complex<double>> from_block16(const std::string& text) {
  const std::vector<std::uint8_t> raw = from_base64(text);
  const std::size_t count = raw.size() / 5;
  std::vector<std::complex<double>> out;
  for (std::size_t i = 0; i < count; ++i) {
    std::int16_t m[2];
    std::memcpy(m, raw.data() + 4 * i, 4);
    const int exponent = static_cast<std::int8_t>(raw[4 * count + i]) - 15;
    out.emplace_back(std::ldexp(m[0], exponent), std::ldexp(m[1], exponent));
  }
  return out;
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
      Eigen::Map<Eigen::RowVectorXcd>(values.data(), static_cast<Eigen::Index>(values.size()));
  const auto decoded = from_block16(encode_complex_block16(matrix));
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
  const auto decoded = from_block16(encode_complex_block16(values));
  EXPECT_EQ(decoded[0], 0.0);
  EXPECT_EQ(decoded[1].real(), std::ldexp(32767.0, 127 - 15));
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
  const std::vector<std::uint8_t> codes = from_base64(encoded.text);
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

}  // namespace
}  // namespace stageid::report
