#include "estimation/model/hold_equivalent.hpp"

#include <cmath>

#include "estimation/model/hold_integral.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// out = magnitude(k) e^{j angle(k)}
template <typename Angle>
void fill_polar(Eigen::Index lines, const Angle& angle, SplitMatrix& out) {
  out.resize(lines, 1);
  for (Eigen::Index k = 0; k < lines; ++k) {
    const auto [magnitude, radians] = angle(k);
    out.re(k, 0) = magnitude * std::cos(radians);
    out.im(k, 0) = magnitude * std::sin(radians);
  }
}

/// out = first (c0 + c1 q + c2 q^2) on every line.
void polynomial(const SplitMatrix& first, const SplitMatrix& q,
                const FractionExpansion::Coefficients& c, SplitMatrix& out) {
  const Eigen::Index lines = q.re.rows();
  out.resize(lines, 1);
  const auto q_re = q.re.col(0).array();
  const auto q_im = q.im.col(0).array();
  const auto f_re = first.re.col(0).array();
  const auto f_im = first.im.col(0).array();
  // Horner: c1 + c2 q, then c0 + q (...).
  const auto i_re = c[1].real() + c[2].real() * q_re - c[2].imag() * q_im;
  const auto i_im = c[1].imag() + c[2].real() * q_im + c[2].imag() * q_re;
  const auto p_re = c[0].real() + q_re * i_re - q_im * i_im;
  const auto p_im = c[0].imag() + q_re * i_im + q_im * i_re;
  out.re.col(0) = (f_re * p_re - f_im * p_im).matrix();
  out.im.col(0) = (f_re * p_im + f_im * p_re).matrix();
}

}  // namespace

HoldEquivalent::HoldEquivalent(const ModelLines& lines, double delay_s)
    : exact_(lines.hold == HoldModel::exact), period_s_(lines.sample_period_s) {
  const Eigen::Index N = lines.omega_rad_s.size();
  const auto omega = [&](Eigen::Index k) { return lines.omega_rad_s[k]; };
  if (exact_) {
    const SplitDelay split = split_delay(delay_s, period_s_);
    rest_s_ = (1.0 - split.fraction) * period_s_;
    fill_polar(
        N, [&](Eigen::Index k) { return std::pair(1.0, omega(k) * period_s_); }, z_);
    fill_polar(
        N,
        [&](Eigen::Index k) {
          return std::pair(1.0, -omega(k) * ((split.whole + 1.0) * period_s_));
        },
        first_);
    constant_ = first_;
    if (split.fraction == 0.0)
      fill_polar(
          N, [&](Eigen::Index k) { return std::pair(1.0, -omega(k) * (split.whole * period_s_)); },
          constant_);
    constant_delay_.set_zero(N, 1);
    return;
  }
  z_.set_zero(N, 1);
  z_.im = lines.omega_rad_s;
  const double hold_delay_s = lines.hold != HoldModel::none ? 0.5 * period_s_ : 0.0;
  fill_polar(
      N,
      [&](Eigen::Index k) {
        const double x = 0.5 * omega(k) * period_s_;
        const double magnitude = lines.hold == HoldModel::sinc ? std::sin(x) / x : 1.0;
        return std::pair(magnitude, -omega(k) * (delay_s + hold_delay_s));
      },
      first_);
  constant_ = first_;
  constant_delay_.resize(N, 1);
  constant_delay_.re = z_.im.cwiseProduct(first_.im);  // -j omega
  constant_delay_.im = -z_.im.cwiseProduct(first_.re);
}

std::complex<double> HoldEquivalent::place(Complex lambda) const {
  return exact_ ? std::exp(lambda * period_s_) : lambda;
}

std::complex<double> HoldEquivalent::place_slope(Complex lambda) const {
  return exact_ ? period_s_ * std::exp(lambda * period_s_) : Complex(1.0);
}

void HoldEquivalent::reciprocal(Complex lambda, SplitMatrix& q) const {
  const Complex pole = place(lambda);
  q.resize(z_.re.rows(), 1);
  const auto re = z_.re.col(0).array() - pole.real();
  const auto im = z_.im.col(0).array() - pole.imag();
  const auto scale = (re * re + im * im).inverse();
  q.re.col(0) = (re * scale).matrix();
  q.im.col(0) = (-im * scale).matrix();
}

void HoldEquivalent::fractions(Complex lambda, Wanted wanted, Fractions& out) const {
  SplitMatrix q;
  reciprocal(lambda, q);
  const FractionExpansion c = expansion(lambda);
  polynomial(first_, q, c.simple, out.simple);
  if (wanted.squares) polynomial(first_, q, c.squared, out.squared);
  if (wanted.delay) polynomial(first_, q, c.simple_delay, out.simple_delay);
  if (wanted.squares && wanted.delay) polynomial(first_, q, c.squared_delay, out.squared_delay);
}

FractionExpansion HoldEquivalent::expansion(Complex lambda) const {
  FractionExpansion c;
  if (!exact_) {
    c.simple = {0.0, 1.0, 0.0};
    c.squared = {0.0, 0.0, 1.0};
    c.simple_delay = {-1.0, -lambda, 0.0};  // times -s, and s q = 1 + lambda q
    c.squared_delay = {0.0, -1.0, -lambda};
    return c;
  }
  const HoldIntegral whole = hold_integral(lambda, period_s_);
  const HoldIntegral part = hold_integral(lambda, rest_s_);
  const Complex e1 = std::exp(lambda * rest_s_);
  const Complex square = whole.value * e1 * place_slope(lambda);
  // d/dlambda of simple, and of simple_delay
  const Complex slope = rest_s_ * lambda * whole.value + whole.value + lambda * whole.derivative;
  c.simple = {part.value, whole.value * e1, 0.0};
  c.squared = {part.derivative, whole.derivative * e1 + whole.value * rest_s_ * e1, square};
  c.simple_delay = {-e1, -e1 * lambda * whole.value, 0.0};
  c.squared_delay = {-e1 * rest_s_, -e1 * slope, -lambda * square};
  return c;
}

}  // namespace stageid
