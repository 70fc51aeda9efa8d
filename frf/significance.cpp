#include "frf/significance.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {

double log_tail_of_f(double x, int a, double b) {
  const double rest = a * x / (b + a * x);  // 1 - w
  double term = 1.0;
  double sum = 1.0;
  for (int j = 1; j < a; ++j) {
    term *= (b + j - 1.0) / j * rest;
    sum += term;
  }
  return std::min(0.0, b * std::log1p(-rest) + std::log(sum));
}

double tail_of_chi_square(double h, Eigen::Index K) {
  if (!(h > 0.0)) return 1.0;
  double sum = 0.0;
  for (Eigen::Index j = 0; j < K; ++j) {
    const double n = static_cast<double>(j);
    sum += std::exp(n * std::log(h) - std::lgamma(n + 1.0) - h);
  }
  return std::min(1.0, sum);
}

}  // namespace stageid
