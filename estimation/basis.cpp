#include "estimation/basis.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <stdexcept>

#include "estimation/hold_integral.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// 1/(s - lambda), 1/(s - lambda)^2 and the delay derivatives of both, on every line.
struct Fractions {
  Eigen::ArrayXcd simple;
  Eigen::ArrayXcd squared;
  Eigen::ArrayXcd simple_delay;
  Eigen::ArrayXcd squared_delay;
};

/// e^{-j omega n T}
Eigen::ArrayXcd shift(const ModelLines& lines, double samples) {
  const Eigen::ArrayXd angle = -lines.omega_rad_s.array() * (samples * lines.sample_period_s);
  Eigen::ArrayXcd out(angle.size());
  for (Eigen::Index k = 0; k < angle.size(); ++k) out[k] = std::polar(1.0, angle[k]);
  return out;
}

/// What multiplies a continuous-time function: delay, and the hold's phase or phase and magnitude.
Eigen::ArrayXcd continuous_factor(const ModelLines& lines, double delay_s) {
  const double period = lines.sample_period_s;
  Eigen::ArrayXcd out(lines.omega_rad_s.size());
  for (Eigen::Index k = 0; k < out.size(); ++k) {
    const double omega = lines.omega_rad_s[k];
    double delay = delay_s;
    double magnitude = 1.0;
    if (lines.hold != HoldModel::none) delay += 0.5 * period;
    if (lines.hold == HoldModel::sinc) {
      const double x = 0.5 * omega * period;
      magnitude = std::sin(x) / x;
    }
    out[k] = std::polar(magnitude, -omega * delay);
  }
  return out;
}

/// Everything about lines and delay that all poles share.
class Operator {
 public:
  Operator(const ModelLines& lines, double delay_s)
      : lines_(lines), exact_(lines.hold == HoldModel::exact) {
    if (exact_) {
      delay_ = split_delay(delay_s, lines.sample_period_s);
      inverse_z_ = shift(lines, 1.0);
      first_ = shift(lines, delay_.whole + 1.0);
    } else {
      s_ = Complex(0.0, 1.0) * lines.omega_rad_s.array().cast<Complex>();
      first_ = continuous_factor(lines, delay_s);
    }
  }

  Fractions fractions(Complex lambda, bool with_squares) const {
    return exact_ ? sampled(lambda, with_squares) : continuous(lambda, with_squares);
  }

  /// The constant 1: a held input seen at the sampling instants.
  Eigen::ArrayXcd constant() const {
    if (!exact_) return first_;
    return delay_.fraction > 0.0 ? first_ : Eigen::ArrayXcd(first_ * inverse_z_.conjugate());
  }
  Eigen::ArrayXcd constant_delay() const {
    if (!exact_) return -s_ * first_;
    return Eigen::ArrayXcd::Zero(first_.size());
  }

 private:
  Fractions continuous(Complex lambda, bool with_squares) const {
    Fractions out;
    const Eigen::ArrayXcd inverse = (s_ - lambda).inverse();
    out.simple = first_ * inverse;
    out.simple_delay = -s_ * out.simple;
    if (with_squares) {
      out.squared = out.simple * inverse;
      out.squared_delay = -s_ * out.squared;
    }
    return out;
  }

  Fractions sampled(Complex lambda, bool with_squares) const {
    const double period = lines_.sample_period_s;
    const double rest = (1.0 - delay_.fraction) * period;
    const HoldIntegral whole = hold_integral(lambda, period);
    const HoldIntegral part = hold_integral(lambda, rest);
    const Complex E = std::exp(lambda * period);
    const Complex e1 = std::exp(lambda * rest);
    Fractions out;
    const Eigen::ArrayXcd q = inverse_z_ / (1.0 - E * inverse_z_);  // z^-1 / (1 - E z^-1)
    out.simple = first_ * (part.value + whole.value * e1 * q);
    out.simple_delay = -e1 * first_ * (1.0 + lambda * whole.value * q);
    if (with_squares) {
      const Complex slope = whole.derivative * e1 + whole.value * rest * e1;
      out.squared = first_ * (part.derivative + slope * q + whole.value * e1 * period * E * q * q);
      // d/dlambda of simple_delay
      const Complex lambda_phi_slope = whole.value + lambda * whole.derivative;
      out.squared_delay = -e1 * first_ *
                          (rest * (1.0 + lambda * whole.value * q) + lambda_phi_slope * q +
                           lambda * whole.value * period * E * q * q);
    }
    return out;
  }

  const ModelLines& lines_;
  bool exact_;
  SplitDelay delay_;
  Eigen::ArrayXcd s_;
  Eigen::ArrayXcd inverse_z_;
  Eigen::ArrayXcd first_;  // exact: z^-(d+1); else delay and hold
};

/// A pole of a rational function with its fractions on the lines.
struct Pole {
  Complex lambda;
  Fractions fractions;
};

/// How often each pole of s^power / (s^l A^times) stands there: the origin first, then the roots.
struct PartialFractions {
  const std::vector<Pole>& poles;  // [0] is the origin
  int origin_multiplicity;
  int root_multiplicity;
  int power;
  double leading;  // coefficient of the highest power of s^l A^times

  int multiplicity(std::size_t r) const { return r == 0 ? origin_multiplicity : root_multiplicity; }

  /// (s - lambda_r)^multiplicity F(s) at s = lambda_r, and its derivative.
  std::pair<Complex, Complex> cofactor(std::size_t r) const {
    const Complex s = poles[r].lambda;
    Complex value = std::pow(s, power) / leading;
    Complex slope = power > 0 ? static_cast<double>(power) / s : Complex(0.0);
    for (std::size_t o = 0; o < poles.size(); ++o) {
      const int times = multiplicity(o);
      if (o == r || times == 0) continue;
      const Complex distance = s - poles[o].lambda;
      value /= times == 1 ? distance : distance * distance;
      slope -= static_cast<double>(times) / distance;
    }
    return {value, value * slope};
  }

  template <typename Add>
  void for_each(Add&& add) const {
    for (std::size_t r = 0; r < poles.size(); ++r) {
      const int times = multiplicity(r);
      if (times == 0) continue;
      const auto [value, slope] = cofactor(r);
      if (times == 1) {
        add(r, value, Complex(0.0));
      } else {
        add(r, slope, value);  // slope / (s - lambda) + value / (s - lambda)^2
      }
    }
  }
};

}  // namespace

std::vector<std::complex<double>> roots(const Eigen::Ref<const Eigen::VectorXd>& a) {
  const Eigen::Index n = a.size();
  if (n == 0) return {};
  if (n == 1) return {Complex(-1.0 / a[0])};
  if (n == 2) {
    const Complex half = std::sqrt(Complex(a[0] * a[0] - 4.0 * a[1]));
    // The larger root first, the other from the product: no cancellation.
    const Complex first = (a[0] >= 0.0 ? -a[0] - half : -a[0] + half) / (2.0 * a[1]);
    return {first, 1.0 / (a[1] * first)};
  }
  // Companion matrix of x^n + a_1 x^{n-1} + ... + a_n, x = 1/s: well scaled for poles of any size.
  const double scale = std::pow(std::abs(a[n - 1]), 1.0 / static_cast<double>(n));
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(n, n);
  double power = 1.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    power *= scale;
    companion(0, i) = -a[i] / power;
    if (i + 1 < n) companion(i + 1, i) = 1.0;
  }
  const Eigen::VectorXcd inverse = companion.eigenvalues();
  std::vector<Complex> out;
  for (const Complex x : inverse) out.push_back(1.0 / (x * scale));
  return out;
}

void evaluate_basis(const ModelLines& lines, const SubmodelShape& shape,
                    const Eigen::Ref<const Eigen::VectorXd>& a, double delay_s, bool with_gradient,
                    SubmodelBasis& out) {
  const Eigen::Index N = lines.omega_rad_s.size();
  const int n = shape.order;
  const int l = shape.integrators;
  if (shape.numerator_degree > n + l) throw std::invalid_argument("model: a submodel is improper");
  if (l > 2) throw std::invalid_argument("model: at most two integrators in a submodel");
  const Operator through(lines, delay_s);

  std::vector<Pole> poles;
  poles.push_back({Complex(0.0), l > 0 ? through.fractions(Complex(0.0), true) : Fractions{}});
  for (const Complex lambda : roots(a))
    poles.push_back({lambda, through.fractions(lambda, with_gradient)});
  const double highest = n > 0 ? a[n - 1] : 1.0;

  out.value.setZero(N, shape.functions());
  out.delay.setZero(N, shape.functions());
  if (with_gradient) out.gradient.setZero(N, Eigen::Index{shape.functions()} * n);

  for (int m = 0; m <= shape.numerator_degree; ++m) {
    const int cancelled = std::min(m, l);
    const PartialFractions value{poles, l - cancelled, 1, m - cancelled, highest};
    value.for_each([&](std::size_t r, Complex simple, Complex squared) {
      const Fractions& f = poles[r].fractions;
      out.value.col(m).array() += simple * f.simple;
      out.delay.col(m).array() += simple * f.simple_delay;
      if (squared == 0.0) return;
      out.value.col(m).array() += squared * f.squared;
      out.delay.col(m).array() += squared * f.squared_delay;
    });
    if (m == n + l) {  // biproper
      out.value.col(m).array() += through.constant() / highest;
      out.delay.col(m).array() += through.constant_delay() / highest;
    }
    if (!with_gradient) continue;
    for (int q = 1; q <= n; ++q) {  // d/da_q = -s^(m+q) / (s^l A^2)
      const int gone = std::min(m + q, l);
      const PartialFractions slope{poles, l - gone, 2, m + q - gone, highest * highest};
      auto column = out.gradient.col(m * n + q - 1).array();
      slope.for_each([&](std::size_t r, Complex simple, Complex squared) {
        column -= simple * poles[r].fractions.simple;
        if (squared != 0.0) column -= squared * poles[r].fractions.squared;
      });
      if (m + q == 2 * n + l) column -= through.constant() / (highest * highest);
    }
  }
}

}  // namespace stageid
