#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

namespace stageid::report {

// Packing of bytes in the page: byte planes, deflate (zlib, RFC 1950), base64. The page unpacks them with the
// browser's own DecompressionStream: tools/report/js/decode.js.

/// RFC 4648, with padding.
std::string base64(std::span<const std::uint8_t> bytes);

/// Deflated, in base64. Equal bytes give equal text.
/// @param level 1 to 9; 9 takes a multiple of the time of 6, for nothing if the bytes are mostly noise
std::string packed(std::span<const std::uint8_t> bytes, int level = 9);

/// The lowest bytes of all numbers, then the next, ...: similar bytes are adjacent, and deflate codes each place
/// separately.
template <typename T>
std::vector<std::uint8_t> byte_planes(const std::vector<T>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint8_t raw[sizeof(T)];
    std::memcpy(raw, &values[i], sizeof(T));
    for (std::size_t plane = 0; plane < sizeof(T); ++plane)
      bytes[plane * values.size() + i] = raw[plane];
  }
  return bytes;
}

// Encoding of numbers as packed bytes of the page: channel by channel, the lines of a channel
// contiguous. Measured data remain float32; data that are only displayed are shorter. Complex numbers are stored minus
// their expected values, which changes no number and lets deflate omit the part that is not noise.
// tools/report/js/decode.js is the reader.

/// Float64, exact.
std::string encode_float64(const Eigen::Ref<const Eigen::VectorXd>& values);

/// Float32, rows of `values` one after another.
std::string encode_float32(const Eigen::Ref<const Eigen::MatrixXd>& values);

/// The expected value of number i, computed by the page from all previously decoded ones: base(i) + d(i) with d(i)
/// extrapolated from d = value - base of the previous numbers (0 before the first). Uses multiplications by 2 and
/// subtractions only, which are rounded equally on every machine, fused or not.
struct Expectation {
  const Eigen::MatrixXcd* base =
      nullptr;    ///< decoded numbers of another array of this shape; none: 0
  int order = 0;  ///< d(i) = 0; 1: d(i-1); 2: 2 d(i-1) - d(i-2)
};

struct ComplexCode {
  std::string text;
  Eigen::MatrixXcd decoded;  ///< as decoded by the page
};

/// Float32 pairs (re, im), exact as such; larger numbers become the largest float32. Each is a word of 32 bits: its
/// index in the order of all float32 minus that of the expected number, sign in the lowest bit.
/// @pre values are finite; base has their shape
ComplexCode encode_complex_float32(const Eigen::MatrixXcd& values, Expectation expected = {});

/// Complex numbers of five bytes: pairs (re, im) of int16 m under one int8 e; the value is m 2^(e-15). The error of a
/// part is at most 2^-15 of the larger part; below 2^-142 it is zero. First all m, minus the expected ones under e
/// modulo 2^16, sign in the lowest bit; then all e, each minus the previous one.
/// @pre values are finite; base has their shape
ComplexCode encode_complex_block16(const Eigen::MatrixXcd& values, Expectation expected = {});

/// Positive numbers of one byte on a logarithmic scale per row.
struct LogBytes {
  std::string text;          ///< codes, each less the one before modulo 256: 0 is "zero", code c is
                             ///< 2^(low + (c - 1) step)
  std::vector<double> low;   ///< per row
  std::vector<double> step;  ///< per row; the error is at most a factor 2^(step / 2)
};
/// @pre values are finite and not negative
LogBytes encode_log_bytes(const Eigen::Ref<const Eigen::MatrixXd>& values);

}  // namespace stageid::report
