#include "estimation/model/poles.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimation/model/basis.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// g_q = dlambda/da_q for q = 1 .. n.
Eigen::VectorXcd root_gradient(const Eigen::Ref<const Eigen::VectorXd>& a, Complex lambda) {
  Eigen::VectorXcd powers(a.size());
  Complex power = 1.0;
  Complex slope = 0.0;
  for (Eigen::Index q = 0; q < a.size(); ++q) {
    slope += static_cast<double>(q + 1) * a[q] * power;
    power *= lambda;
    powers[q] = power;
  }
  return -powers / slope;
}

double deviation(const Eigen::VectorXd& gradient,
                 const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  return std::sqrt(std::max(0.0, gradient.dot(covariance * gradient)));
}

}  // namespace

Eigen::VectorXd denominator_of(const std::vector<Complex>& poles) {
  Eigen::VectorXcd A = Eigen::VectorXcd::Zero(std::ssize(poles) + 1);
  A[0] = 1.0;
  Eigen::Index degree = 0;
  for (const Complex lambda : poles) {
    ++degree;
    for (Eigen::Index q = degree; q > 0; --q) A[q] -= A[q - 1] / lambda;
  }
  return A.tail(degree).real();
}

std::vector<Complex> mode_poles(double frequency_hz, double damping_ratio) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  const Complex pole(-damping_ratio * omega,
                     omega * std::sqrt(1.0 - damping_ratio * damping_ratio));
  return {pole, std::conj(pole)};
}

std::vector<PoleEstimate> pole_estimates(const Eigen::Ref<const Eigen::VectorXd>& a,
                                         const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  std::vector<PoleEstimate> out;
  for (const Complex lambda : roots(a)) {
    if (lambda.imag() < 0.0) continue;
    const double size = std::abs(lambda);
    PoleEstimate pole{size / (2.0 * std::numbers::pi), -lambda.real() / size, {}, {}};
    if (covariance.size() > 0) {
      const Eigen::VectorXcd g = root_gradient(a, lambda);
      const Eigen::VectorXd relative = (g / lambda).real();  // of |lambda|
      pole.natural_frequency_std_hz = deviation(relative, covariance) * pole.natural_frequency_hz;
      if (lambda.imag() > 0.0)
        pole.damping_ratio_std = deviation(
            Eigen::VectorXd(g.real() / size - lambda.real() / size * relative), covariance);
    }
    out.push_back(pole);
  }
  std::ranges::stable_sort(out, {}, &PoleEstimate::natural_frequency_hz);
  return out;
}

}  // namespace stageid
