#include "hal/stage/linear_controller.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "excitation/decompositions/decompositions.hpp"
#include "hal/stage/controller_sections.hpp"
#include "hal/stage/require.hpp"

namespace stageid {
namespace {

using Eigen::Index;

std::vector<double> without_leading_zeros(std::vector<double> coefficients) {
  const auto first = std::find_if(coefficients.begin(), coefficients.end(),
                                  [](double value) { return value != 0.0; });
  coefficients.erase(coefficients.begin(), first);
  return coefficients;
}

/// The factor 1 + c1 z^-1 + c2 z^-2 of one or two roots.
struct Factor {
  int degree = 0;
  double c1 = 0.0;
  double c2 = 0.0;
};

/// Of a polynomial whose first coefficient is not zero; factors of second degree first.
std::vector<Factor> factors_of(const std::vector<double>& coefficients) {
  const auto degree = static_cast<Index>(coefficients.size()) - 1;
  if (degree < 1) return {};
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(degree, degree);
  companion.diagonal(-1).setOnes();
  for (Index i = 0; i < degree; ++i)
    companion(0, i) = -coefficients[static_cast<std::size_t>(i + 1)] / coefficients.front();
  const Eigen::VectorXcd roots = eigenvalues(companion);
  std::vector<Factor> factors;
  std::vector<double> real;
  for (const std::complex<double>& root : roots) {
    if (root.imag() > 0.0) factors.push_back({2, -2.0 * root.real(), std::norm(root)});
    if (root.imag() == 0.0) real.push_back(root.real());
  }
  std::sort(real.begin(), real.end());
  for (std::size_t i = 0; i + 1 < real.size(); i += 2)
    factors.push_back({2, -(real[i] + real[i + 1]), real[i] * real[i + 1]});
  if (real.size() % 2 == 1) factors.push_back({1, -real.back(), 0.0});
  return factors;
}

}  // namespace

std::vector<BiquadSection> transfer_sections(const ControllerTransfer& transfer) {
  for (const auto* list : {&transfer.numerator, &transfer.denominator})
    for (const double value : *list)
      require(std::isfinite(value),
              "controller: a coefficient of a transfer function is not finite; write finite "
              "numbers");
  const std::vector<double> denominator = without_leading_zeros(transfer.denominator);
  const std::vector<double> numerator = without_leading_zeros(transfer.numerator);
  require(!denominator.empty(),
          "controller: the denominator of a transfer function is zero; write at least one nonzero "
          "coefficient");
  require(numerator.size() <= denominator.size(),
          "controller: a transfer function has {} zeros and {} poles; a controller is causal only "
          "with at least as many poles as zeros",
          numerator.size() - 1, denominator.size() - 1);
  if (numerator.empty()) return {BiquadSection{.b0 = 0.0}};

  const std::vector<Factor> poles = factors_of(denominator);
  std::vector<Factor> zeros = factors_of(numerator);
  zeros.resize(poles.size());  // factors of degree 0
  std::vector<BiquadSection> sections;
  for (std::size_t i = 0; i < poles.size(); ++i) {
    const Factor& zero = zeros[i];
    double b[3] = {};
    const int delay = poles[i].degree - zero.degree;
    b[delay] = 1.0;
    if (zero.degree > 0) b[delay + 1] = zero.c1;
    if (zero.degree > 1) b[delay + 2] = zero.c2;
    sections.push_back({b[0], b[1], b[2], poles[i].c1, poles[i].c2});
  }
  if (sections.empty()) sections.emplace_back();
  const double gain = numerator.front() / denominator.front();
  for (double* b : {&sections[0].b0, &sections[0].b1, &sections[0].b2}) *b *= gain;
  return sections;
}

}  // namespace stageid
