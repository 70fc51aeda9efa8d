#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace stageid::report {

// How numbers become bytes of the page (report_packing.hpp packs them): one channel after the other, the
// lines of a channel side by side. What is measured stays float32; what is only looked at is shorter.
// Complex numbers are coded less what the page expects of them, which changes no number and lets deflate
// leave out what noise does not fill. tools/report/js/decode.js is the reader.

/// Float64, exact.
std::string encode_float64(const Eigen::Ref<const Eigen::VectorXd>& values);

/// Float32, rows of `values` one after the other.
std::string encode_float32(const Eigen::Ref<const Eigen::MatrixXd>& values);

/// What the page expects number i to be, from all that it has decoded before: base(i) + d(i) with d(i)
/// extrapolated from d = value - base of the numbers before it (0 before the first). Multiplications by 2
/// and subtractions only: each is rounded alike on every machine, fused or not.
struct Expectation {
  const Eigen::MatrixXcd* base =
      nullptr;    ///< decoded numbers of another array of this shape; none: 0
  int order = 0;  ///< d(i) = 0; 1: d(i-1); 2: 2 d(i-1) - d(i-2)
};

struct ComplexCode {
  std::string text;
  Eigen::MatrixXcd decoded;  ///< what the page gets back
};

/// Float32 pairs (re, im), exact as such; beyond float32 they are its largest number. Each is a word of 32
/// bits: its place in the order of all float32 less that of the expected number, sign in the lowest bit.
/// @pre values are finite; base has their shape
ComplexCode encode_complex_float32(const Eigen::MatrixXcd& values, Expectation expected = {});

/// Complex numbers of five bytes: pairs (re, im) of int16 m under one int8 e; the value is m 2^(e-15). The
/// error of a part is at most 2^-15 of the larger part; below 2^-142 it is zero. First all m, less the
/// expected ones under e modulo 2^16, sign in the lowest bit; then all e, each less the one before.
/// @pre values are finite; base has their shape
ComplexCode encode_complex_block16(const Eigen::MatrixXcd& values, Expectation expected = {});

/// Positive numbers of one byte on a logarithmic scale, each row its own.
struct LogBytes {
  std::string text;          ///< codes, each less the one before modulo 256: 0 is "zero", code c is
                             ///< 2^(low + (c - 1) step)
  std::vector<double> low;   ///< a row
  std::vector<double> step;  ///< a row; the error is at most a factor 2^(step / 2)
};
/// @pre values are finite and not negative
LogBytes encode_log_bytes(const Eigen::Ref<const Eigen::MatrixXd>& values);

}  // namespace stageid::report
