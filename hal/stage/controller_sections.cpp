#include "hal/stage/controller_sections.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

// c2 s^2 + c1 s + c0
struct Quadratic {
  double c2, c1, c0;
};

// s -> k (z - 1) / (z + 1), multiplied through by (z + 1)^2 and divided by z^2.
BiquadSection tustin(const Quadratic& numerator, const Quadratic& denominator, double k) {
  const auto substitute = [k](const Quadratic& q, double out[3]) {
    const double square = q.c2 * k * k;
    const double linear = q.c1 * k;
    out[0] = square + linear + q.c0;
    out[1] = 2.0 * (q.c0 - square);
    out[2] = square - linear + q.c0;
  };
  double b[3];
  double a[3];
  substitute(numerator, b);
  substitute(denominator, a);
  return {b[0] / a[0], b[1] / a[0], b[2] / a[0], a[1] / a[0], a[2] / a[0]};
}

// Warps this frequency so that Tustin's method is exact there.
double prewarped(double frequency_hz, double sample_rate_hz) {
  return kTwoPi * frequency_hz / std::tan(std::numbers::pi * frequency_hz / sample_rate_hz);
}

void check(bool holds, const char* field, double value, const char* wanted) {
  require(holds, "controller: {} is {}; must be {}", field, value, wanted);
}

void check_frequency(const char* field, double hz, double nyquist_hz, bool zero_allowed) {
  require((zero_allowed ? hz >= 0.0 : hz > 0.0) && hz < nyquist_hz,
          "controller: {} is {}; must be {} and below the Nyquist frequency, {} Hz", field, hz,
          zero_allowed ? "0 (off) or positive" : "positive", nyquist_hz);
}

void check(const AxisController& axis, double nyquist_hz) {
  check(std::isfinite(axis.gain), "gain", axis.gain, "finite");
  check_frequency("crossover_hz", axis.crossover_hz, nyquist_hz, false);
  check_frequency("integrator_hz", axis.integrator_hz, nyquist_hz, true);
  check_frequency("lead_zero_hz", axis.lead_zero_hz, nyquist_hz, true);
  check_frequency("lead_pole_hz", axis.lead_pole_hz, nyquist_hz, true);
  check_frequency("lowpass_hz", axis.lowpass_hz, nyquist_hz, true);
  check(axis.lead_zero_hz == 0.0 || axis.lead_pole_hz > 0.0, "lead_pole_hz", 0.0,
        "positive if lead_zero_hz is set");
  check(
      axis.lowpass_hz == 0.0 || (axis.lowpass_damping > 0.0 && std::isfinite(axis.lowpass_damping)),
      "lowpass_damping", axis.lowpass_damping, "positive");
  for (const auto& notch : axis.notches) {
    check_frequency("notch frequency_hz", notch.frequency_hz, nyquist_hz, false);
    check(notch.zero_damping >= 0.0 && std::isfinite(notch.zero_damping), "notch zero_damping",
          notch.zero_damping, "0 or more");
    check(notch.pole_damping > 0.0 && std::isfinite(notch.pole_damping), "notch pole_damping",
          notch.pole_damping, "positive");
  }
}

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
  const auto degree = static_cast<Eigen::Index>(coefficients.size()) - 1;
  if (degree < 1) return {};
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(degree, degree);
  companion.diagonal(-1).setOnes();
  for (Eigen::Index i = 0; i < degree; ++i)
    companion(0, i) = -coefficients[i + 1] / coefficients.front();
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

std::vector<BiquadSection> controller_sections(const AxisController& axis, double sample_rate_hz) {
  check(axis, 0.5 * sample_rate_hz);
  const double k = prewarped(axis.crossover_hz, sample_rate_hz);
  std::vector<BiquadSection> sections;

  // gain (s + w_i)(s/w_1 + 1) over s (s/w_2 + 1); disabled factors are left out.
  const double wi = kTwoPi * axis.integrator_hz;
  const double zero = axis.lead_zero_hz > 0.0 ? 1.0 / (kTwoPi * axis.lead_zero_hz) : 0.0;
  const double pole = axis.lead_pole_hz > 0.0 ? 1.0 / (kTwoPi * axis.lead_pole_hz) : 0.0;
  const double g = axis.gain;
  if (wi > 0.0) {
    sections.push_back(tustin({g * zero, g * (1.0 + wi * zero), g * wi}, {pole, 1.0, 0.0}, k));
  } else {
    sections.push_back(tustin({0.0, g * zero, g}, {0.0, pole, 1.0}, k));
  }
  if (axis.lowpass_hz > 0.0) {
    const double w = kTwoPi * axis.lowpass_hz;
    sections.push_back(
        tustin({0.0, 0.0, 1.0}, {1.0 / (w * w), 2.0 * axis.lowpass_damping / w, 1.0}, k));
  }
  for (const auto& notch : axis.notches) {
    const double w = kTwoPi * notch.frequency_hz;
    sections.push_back(tustin({1.0 / (w * w), 2.0 * notch.zero_damping / w, 1.0},
                              {1.0 / (w * w), 2.0 * notch.pole_damping / w, 1.0},
                              prewarped(notch.frequency_hz, sample_rate_hz)));
  }
  return sections;
}

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
