#include "tests/support/models/model_reference.hpp"

#include <Eigen/LU>
#include <cmath>
#include <map>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

namespace stageid::test {
namespace {

using Complex = std::complex<double>;
using Long = long double;
using LongComplex = std::complex<long double>;
using LongMatrix = Eigen::Matrix<Long, Eigen::Dynamic, Eigen::Dynamic>;
using LongComplexMatrix = Eigen::Matrix<LongComplex, Eigen::Dynamic, Eigen::Dynamic>;

constexpr Complex kJ{0.0, 1.0};

/// integral of e^{A t} b over [0, length]: the upper right block of exp([A b; 0 0] length).
struct HeldStep {
  LongMatrix transition;  ///< e^{A length}
  LongMatrix input;
};

HeldStep held_step(const LongMatrix& A, const LongMatrix& b, Long length) {
  const Eigen::Index n = A.rows();
  LongMatrix block = LongMatrix::Zero(n + 1, n + 1);
  block.topLeftCorner(n, n) = A * length;
  block.topRightCorner(n, 1) = b * length;
  const LongMatrix exponential = block.exp();
  return {exponential.topLeftCorner(n, n), exponential.topRightCorner(n, 1)};
}

/// Sampled state space of one function with time in samples: x+ = A x + B1 u(k-d-1) + B0 u(k-d).
struct SampledSystem {
  LongMatrix A;
  LongMatrix B0;
  LongMatrix B1;
  LongMatrix C;
  Long direct = 0.0L;
  int whole_delay = 0;
  bool fractional = false;
};

SampledSystem make_sampled(const RationalFunction& function, double period_s, double delay_s) {
  const auto n = static_cast<Eigen::Index>(function.order());
  const Long T = period_s;
  // Denominator as a monic polynomial of x = s T.
  std::vector<Long> coefficient(static_cast<std::size_t>(n) + 1, 0.0L);
  for (std::size_t i = 0; i <= function.a.size(); ++i)
    coefficient[static_cast<std::size_t>(function.integrators) + i] =
        (i == 0 ? 1.0L : static_cast<Long>(function.a[i - 1])) /
        std::pow(T, static_cast<Long>(function.integrators) + static_cast<Long>(i));
  const Long highest = coefficient.back();
  const Long gain = std::pow(T, -static_cast<Long>(function.power)) / highest;

  LongMatrix A = LongMatrix::Zero(n, n);
  LongMatrix b = LongMatrix::Zero(n, 1);
  LongMatrix c = LongMatrix::Zero(1, n);
  SampledSystem out;
  for (Eigen::Index i = 0; i + 1 < n; ++i) A(i, i + 1) = 1.0L;
  if (n > 0) {
    for (Eigen::Index i = 0; i < n; ++i) A(n - 1, i) = -coefficient[i] / highest;
    b(n - 1, 0) = 1.0L;
  }
  if (function.power < n) {
    c(0, function.power) = gain;
  } else {  // x^n / a(x) = 1 - (rest) / a(x)
    out.direct = gain;
    for (Eigen::Index i = 0; i < n; ++i) c(0, i) = -gain * coefficient[i] / highest;
  }

  const Long samples = static_cast<Long>(delay_s) / T;
  // A delay that is a whole number of samples up to its last bit counts as whole.
  const Long nearest = std::round(samples);
  const bool whole = std::abs(samples - nearest) < 1e-12L;
  out.whole_delay = static_cast<int>(whole ? nearest : std::floor(samples));
  const Long rest = whole ? 0.0L : samples - std::floor(samples);
  out.fractional = !whole;
  out.C = c;
  const HeldStep late = held_step(A, b, 1.0L - rest);
  const HeldStep early = held_step(A, b, rest);
  out.A = late.transition * early.transition;
  out.B0 = late.input;
  out.B1 = late.transition * early.input;
  return out;
}

Complex evaluate(const SampledSystem& system, double angle) {
  const LongComplex z(std::cos(static_cast<Long>(angle)), std::sin(static_cast<Long>(angle)));
  const LongComplex inverse = std::conj(z);
  const Eigen::Index n = system.A.rows();
  LongComplex value = 0.0L;
  if (n > 0) {
    const LongComplexMatrix left =
        z * LongComplexMatrix::Identity(n, n) - system.A.cast<LongComplex>();
    const LongComplexMatrix right =
        system.B0.cast<LongComplex>() + inverse * system.B1.cast<LongComplex>();
    value = (system.C.cast<LongComplex>() * left.partialPivLu().solve(right))(0, 0);
  }
  value += system.direct * (system.fractional ? inverse : LongComplex(1.0L));
  for (int i = 0; i < system.whole_delay; ++i) value *= inverse;
  return {static_cast<double>(value.real()), static_cast<double>(value.imag())};
}

}  // namespace

std::vector<double> mode_coefficients(double frequency_hz, double damping_ratio) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  return {2.0 * damping_ratio / omega, 1.0 / (omega * omega)};
}

Complex evaluate(const RationalFunction& function, Complex s) {
  Complex A = 1.0;
  for (std::size_t q = 0; q < function.a.size(); ++q)
    A += function.a[q] * std::pow(s, static_cast<double>(q + 1));
  return std::pow(s, static_cast<double>(function.power - function.integrators)) / A;
}

Complex sampled(const RationalFunction& function, double omega_rad_s, double period_s,
                double delay_s) {
  return evaluate(make_sampled(function, period_s, delay_s), omega_rad_s * period_s);
}

AliasingSum aliasing_sum(const RationalFunction& function, double omega_rad_s, double period_s,
                         double delay_s, int terms) {
  const double sampling = 2.0 * std::numbers::pi / period_s;
  // 1 - e^{-s_n T}, the same for every n, without its cancellation on slow lines.
  const double half = 0.5 * omega_rad_s * period_s;
  const Complex held = std::polar(2.0 * std::sin(half), std::numbers::pi / 2.0 - half);
  AliasingSum out;
  // The smallest terms first.
  for (int n = terms; n >= 0; --n)
    for (const int sign : {1, -1}) {
      if (n == 0 && sign < 0) continue;
      const Complex s = kJ * (omega_rad_s + sign * n * sampling);
      out.value += evaluate(function, s) * held / s * std::exp(-s * delay_s) / period_s;
    }
  // |G(s)| <= c |s|^-r beyond the last term, where it is within a few per cent of its asymptote
  // (the factor 1.1), so that the two tails are below 2 integral c x^-(r+1) dx from (terms - 1/2).
  const int r = function.relative_degree();
  const double leading = function.a.empty() ? 1.0 : std::abs(1.0 / function.a.back());
  const double from = (terms - 0.5) * sampling - omega_rad_s;
  out.tail = 1.1 * 2.0 * leading * std::abs(held) / period_s / sampling * std::pow(from, -r) / r;
  return out;
}

Complex through(const RationalFunction& function, HoldModel hold, double omega_rad_s,
                double period_s, double delay_s) {
  if (hold == HoldModel::exact) return sampled(function, omega_rad_s, period_s, delay_s);
  const Complex s = kJ * omega_rad_s;
  Complex value = evaluate(function, s) * std::exp(-s * delay_s);
  if (hold == HoldModel::phase) value *= std::exp(-s * (period_s / 2.0));
  if (hold == HoldModel::sinc) value *= (1.0 - std::exp(-s * period_s)) / (s * period_s);
  return value;
}

Eigen::MatrixXcd reference_response(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
                                    HoldModel hold) {
  const Eigen::Index n_y = model.n_outputs();
  const Eigen::Index N = frequency_hz.size();
  const double period = model.sample_rate_hz > 0.0 ? 1.0 / model.sample_rate_hz : 0.0;
  const auto delay_of = [](const Eigen::VectorXd& delays, Eigen::Index i) {
    return delays.size() > 0 ? delays[i] : 0.0;
  };
  Eigen::MatrixXcd P = Eigen::MatrixXcd::Zero(n_y * model.n_inputs(), N);
  for (const Submodel& submodel : model.submodels)
    for (std::size_t m = 0; m < submodel.numerator.size(); ++m) {
      const RationalFunction function{
          submodel.integrators,
          {submodel.denominator.begin() + 1, submodel.denominator.end()},
          static_cast<int>(m)};
      std::map<double, Eigen::VectorXcd> known;  // by delay
      for (Eigen::Index u = 0; u < model.n_inputs(); ++u)
        for (Eigen::Index y = 0; y < n_y; ++y) {
          const double delay = delay_of(model.input_delay_s, u) + delay_of(model.output_delay_s, y);
          Eigen::VectorXcd& values = known[delay];
          if (values.size() == 0) {
            values.resize(N);
            const SampledSystem system =
                hold == HoldModel::exact ? make_sampled(function, period, delay) : SampledSystem{};
            for (Eigen::Index k = 0; k < N; ++k) {
              const double omega = 2.0 * std::numbers::pi * frequency_hz[k];
              values[k] = hold == HoldModel::exact ? evaluate(system, omega * period)
                                                   : through(function, hold, omega, period, delay);
            }
          }
          P.row(y + n_y * u) += submodel.numerator[m](y, u) * values.transpose();
        }
    }
  return P;
}

double reference_cost(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
                      HoldModel hold, const Eigen::MatrixXcd& G, const Eigen::MatrixXd& W) {
  const Eigen::MatrixXcd P = reference_response(model, frequency_hz, hold);
  long double sum = 0.0L;
  for (Eigen::Index k = 0; k < G.cols(); ++k)
    for (Eigen::Index c = 0; c < G.rows(); ++c)
      sum += static_cast<long double>(W(c, k) * std::norm(G(c, k) - P(c, k)));
  return static_cast<double>(sum) / (2.0 * static_cast<double>(G.cols()));
}

}  // namespace stageid::test
