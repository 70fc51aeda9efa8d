#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stageid::report {

// How numbers travel inside the page: little-endian bytes in base64, one channel after the other
// (channel-major, the lines of a channel side by side). What is measured stays float32; what is
// only looked at is shorter, so that 4 x 13 x 4000 lines stay below 5 MB. tools/report/js/data.js
// is the reader.

/// RFC 4648, with padding.
std::string base64(std::span<const std::uint8_t> bytes);

/// Float64.
std::string encode_float64(const Eigen::Ref<const Eigen::VectorXd>& values);

/// Float32, rows of `values` one after the other.
std::string encode_float32(const Eigen::Ref<const Eigen::MatrixXd>& values);

/// Float32 pairs (re, im), rows of `values` one after the other.
std::string encode_complex_float32(const Eigen::Ref<const Eigen::MatrixXcd>& values);

/// Complex numbers of five bytes: all pairs (re, im) as int16 m, then all exponents e as int8; the
/// value is m 2^(e-15), both parts under one exponent. The error of a part is at most 2^-15 of the
/// larger part; below 2^-142 it is zero.
std::string encode_complex_block16(const Eigen::Ref<const Eigen::MatrixXcd>& values);

/// Positive numbers of one byte on a logarithmic scale, each row its own.
struct LogBytes {
  std::string text;          ///< base64 of codes: 0 is "zero", code c is 2^(low + (c - 1) step)
  std::vector<double> low;   ///< a row
  std::vector<double> step;  ///< a row; the error is at most a factor 2^(step / 2)
};
/// @pre values are finite and not negative
LogBytes encode_log_bytes(const Eigen::Ref<const Eigen::MatrixXd>& values);

}  // namespace stageid::report
