#pragma once

#include <complex>
#include <utility>
#include <vector>

namespace stageid {

/// Partial fractions of s^power / (s^l A^times), with the multiplicity of each pole: the origin first, then the roots
/// of A.
struct PartialFractions {
  const std::vector<std::complex<double>>& poles;  ///< [0] is the origin
  int origin_multiplicity;
  int root_multiplicity;
  int power;
  double leading;  ///< coefficient of the highest power of s^l A^times

  int multiplicity(std::size_t r) const { return r == 0 ? origin_multiplicity : root_multiplicity; }

  /// Calls add(r, simple, squared) per pole, whose part is simple / (s - lambda) + squared / (s - lambda)^2.
  template <typename Add>
  void for_each(Add&& add) const {
    for (std::size_t r = 0; r < poles.size(); ++r) {
      const int times = multiplicity(r);
      if (times == 0) continue;
      const auto [value, slope] = cofactor(r);
      if (times == 1) {
        add(r, value, std::complex<double>(0.0));
      } else {
        add(r, slope, value);
      }
    }
  }

 private:
  /// (s - lambda_r)^multiplicity F(s) at s = lambda_r, and its derivative.
  std::pair<std::complex<double>, std::complex<double>> cofactor(std::size_t r) const {
    using Complex = std::complex<double>;
    const Complex s = poles[r];
    Complex value = std::pow(s, power) / leading;
    Complex slope = power > 0 ? static_cast<double>(power) / s : Complex(0.0);
    for (std::size_t o = 0; o < poles.size(); ++o) {
      const int times = multiplicity(o);
      if (o == r || times == 0) continue;
      const Complex distance = s - poles[o];
      value /= times == 1 ? distance : distance * distance;
      slope -= static_cast<double>(times) / distance;
    }
    return {value, value * slope};
  }
};

}  // namespace stageid
