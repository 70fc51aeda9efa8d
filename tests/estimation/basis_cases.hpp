#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "estimation/model/basis.hpp"
#include "tests/support/models/model_reference.hpp"

// Submodels of every kind, the lines they are evaluated on, and how far rounding may take them.
namespace stageid::test::basis {

using Complex = std::complex<double>;

inline constexpr double kEps = std::numeric_limits<double>::epsilon();
inline constexpr double kPeriod = 1e-4;
inline constexpr Complex kJ{0.0, 1.0};

/// A submodel built from its poles, so that its polynomial is not the library's own.
struct Case {
  std::string name;
  int integrators = 0;
  std::vector<Complex> poles;  ///< rad/s
  int numerator_degree = 0;

  std::vector<double> a() const {
    std::vector<Complex> product = {1.0};  // prod (1 - s / lambda)
    for (const Complex pole : poles) {
      product.push_back(0.0);
      for (std::size_t i = product.size() - 1; i > 0; --i) product[i] -= product[i - 1] / pole;
    }
    std::vector<double> out;
    for (std::size_t i = 1; i < product.size(); ++i) out.push_back(product[i].real());
    return out;
  }
  SubmodelShape shape() const {
    return {integrators, static_cast<int>(poles.size()), numerator_degree};
  }
  RationalFunction function(int power) const { return {integrators, a(), power}; }
};

inline Complex mode_pole(double frequency_hz, double damping) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  return omega * Complex(-damping, std::sqrt(1.0 - damping * damping));
}

inline std::vector<Complex> operator+(std::vector<Complex> left,
                                      const std::vector<Complex>& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

inline std::vector<Complex> mode_poles(double frequency_hz, double damping) {
  const Complex pole = mode_pole(frequency_hz, damping);
  return {pole, std::conj(pole)};
}

inline std::vector<Complex> real_pole(double frequency_hz) {
  return {-2.0 * std::numbers::pi * frequency_hz};
}

inline std::vector<Case> cases() {
  return {
      {"first order", 0, real_pole(150.0), 0},
      {"slow first order", 0, real_pole(0.3), 0},
      {"fast first order", 0, real_pole(9000.0), 0},
      {"integrator", 1, {}, 0},
      {"double integrator", 2, {}, 0},
      {"double integrator with damping force", 2, {}, 1},
      {"integrator and lag", 1, real_pole(40.0), 1},
      {"mode", 0, mode_poles(480.0, 0.005), 0},
      {"general viscous mode", 0, mode_poles(1200.0, 0.01), 1},
      {"slow mode", 0, mode_poles(0.3, 0.02), 0},
      {"fast mode above the sampling", 0, mode_poles(7300.0, 0.03), 0},
      {"overdamped mode", 0, real_pole(20.0) + real_pole(900.0), 1},
      {"third order", 0, mode_poles(700.0, 0.02) + real_pole(300.0), 2},
      {"fourth order", 0, mode_poles(300.0, 0.03) + mode_poles(1100.0, 0.05), 3},
      {"double integrator and mode", 2, mode_poles(900.0, 0.01), 2},
  };
}

inline Eigen::VectorXd lines_hz() {
  return Eigen::VectorXd{{0.25, 1.0, 20.25, 99.75, 480.0, 1000.25, 1999.75, 4500.0}};
}

inline ModelLines lines(HoldModel hold) {
  return {2.0 * std::numbers::pi * lines_hz(), hold == HoldModel::none ? 0.0 : kPeriod, hold};
}

inline SubmodelBasis evaluate(const Case& c, HoldModel hold, double delay_s) {
  const std::vector<double> a = c.a();
  SubmodelBasis out;
  evaluate_basis(HoldEquivalent(lines(hold), delay_s), c.shape(),
                 Eigen::Map<const Eigen::VectorXd>(a.data(), std::ssize(a)),
                 {.gradient = true, .delay = true}, out);
  return out;
}

/// By how much rounding grows, relative to the function: its partial fractions are larger than
/// itself by (omega / slowest pole)^(relative degree - 1), by how close the poles are, a fraction
/// is as sensitive as it is resonant, and 1 - e^{lambda T} z^-1 cancels for lines and poles that
/// are slow against the sampling.
inline double amplification(const Case& c, int power, int multiplicity, double omega) {
  double slowest = 1e300;
  double fastest = 1.0;
  double separation = 1.0;
  double resonance = 1.0;
  double cancellation = c.integrators > 0 ? 1.0 / std::min(1.0, omega * kPeriod) : 1.0;
  for (std::size_t i = 0; i < c.poles.size(); ++i) {
    const Complex pole = c.poles[i];
    slowest = std::min(slowest, std::abs(pole));
    fastest = std::max(fastest, std::abs(pole));
    resonance = std::max(resonance, omega / std::abs(kJ * omega - pole));
    const Complex distance = 1.0 - std::exp((pole - kJ * omega) * kPeriod);
    cancellation = std::max(cancellation, 1.0 / std::abs(distance));
    for (std::size_t j = 0; j < i; ++j)
      separation = std::max(separation, std::abs(pole) / std::abs(pole - c.poles[j]));
  }
  const int relative_degree =
      c.integrators + multiplicity * static_cast<int>(c.poles.size()) - power;
  double growth = c.poles.empty() ? 1.0 : std::pow(1.0 + omega / slowest, relative_degree - 1);
  // Below all poles a function with zeros at the origin is smaller than its fractions.
  if (!c.poles.empty() && power > c.integrators)
    growth *= std::pow(1.0 + fastest / omega, power - c.integrators);
  if (!c.poles.empty() && c.integrators > 0) growth *= std::pow(1.0 + slowest / omega, 2.0);
  return growth * std::pow(separation, multiplicity) * (resonance + cancellation);
}

}  // namespace stageid::test::basis
