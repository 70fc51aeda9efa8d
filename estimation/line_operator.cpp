#include "estimation/line_operator.hpp"

#include <cmath>

#include "estimation/hold_integral.hpp"

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

/// out = a b on every line.
void multiply(const SplitMatrix& a, const SplitMatrix& b, SplitMatrix& out) {
  out.resize(a.re.rows(), 1);
  out.re = a.re.cwiseProduct(b.re) - a.im.cwiseProduct(b.im);
  out.im = a.re.cwiseProduct(b.im) + a.im.cwiseProduct(b.re);
}

/// out = first (c0 + c1 q + c2 q^2) on every line.
void polynomial(const SplitMatrix& first, const SplitMatrix& q, Complex c0, Complex c1, Complex c2,
                SplitMatrix& out) {
  const Eigen::Index lines = q.re.rows();
  out.resize(lines, 1);
  const auto q_re = q.re.col(0).array();
  const auto q_im = q.im.col(0).array();
  const auto f_re = first.re.col(0).array();
  const auto f_im = first.im.col(0).array();
  // Horner: c1 + c2 q, then c0 + q (...).
  const auto i_re = c1.real() + c2.real() * q_re - c2.imag() * q_im;
  const auto i_im = c1.imag() + c2.real() * q_im + c2.imag() * q_re;
  const auto p_re = c0.real() + q_re * i_re - q_im * i_im;
  const auto p_im = c0.imag() + q_re * i_im + q_im * i_re;
  out.re.col(0) = (f_re * p_re - f_im * p_im).matrix();
  out.im.col(0) = (f_re * p_im + f_im * p_re).matrix();
}

/// out = 1 / (z - pole) on every line.
void reciprocal(const SplitMatrix& z, Complex pole, SplitMatrix& out) {
  out.resize(z.re.rows(), 1);
  const auto re = z.re.col(0).array() - pole.real();
  const auto im = z.im.col(0).array() - pole.imag();
  const auto scale = (re * re + im * im).inverse();
  out.re.col(0) = (re * scale).matrix();
  out.im.col(0) = (-im * scale).matrix();
}

}  // namespace

LineOperator::LineOperator(const ModelLines& lines, double delay_s)
    : exact_(lines.hold == HoldModel::exact), period_s_(lines.sample_period_s) {
  const Eigen::Index N = lines.omega_rad_s.size();
  const auto omega = [&](Eigen::Index k) { return lines.omega_rad_s[k]; };
  if (exact_) {
    const auto [whole, fraction] = split_delay(delay_s, period_s_);
    rest_s_ = (1.0 - fraction) * period_s_;
    fill_polar(
        N, [&](Eigen::Index k) { return std::pair(1.0, omega(k) * period_s_); }, z_);
    fill_polar(
        N, [&](Eigen::Index k) { return std::pair(1.0, -omega(k) * ((whole + 1.0) * period_s_)); },
        first_);
    constant_ = first_;
    if (fraction == 0.0)
      fill_polar(
          N, [&](Eigen::Index k) { return std::pair(1.0, -omega(k) * (whole * period_s_)); },
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

void LineOperator::fractions(Complex lambda, Wanted wanted, Fractions& out) const {
  if (exact_)
    sampled(lambda, wanted, out);
  else
    continuous(lambda, wanted, out);
}

void LineOperator::continuous(Complex lambda, Wanted wanted, Fractions& out) const {
  SplitMatrix inverse;
  reciprocal(z_, lambda, inverse);
  multiply(first_, inverse, out.simple);
  if (wanted.squares) multiply(out.simple, inverse, out.squared);
  if (!wanted.delay) return;
  // d/d delay: times -j omega.
  const auto delayed = [&](const SplitMatrix& x, SplitMatrix& slope) {
    slope.resize(x.re.rows(), 1);
    slope.re = z_.im.cwiseProduct(x.im);
    slope.im = -z_.im.cwiseProduct(x.re);
  };
  delayed(out.simple, out.simple_delay);
  if (wanted.squares) delayed(out.squared, out.squared_delay);
}

void LineOperator::sampled(Complex lambda, Wanted wanted, Fractions& out) const {
  const HoldIntegral whole = hold_integral(lambda, period_s_);
  const HoldIntegral part = hold_integral(lambda, rest_s_);
  const Complex E = std::exp(lambda * period_s_);
  const Complex e1 = std::exp(lambda * rest_s_);
  SplitMatrix q;  // z^-1 / (1 - E z^-1)
  reciprocal(z_, E, q);
  polynomial(first_, q, part.value, whole.value * e1, 0.0, out.simple);
  const Complex square = whole.value * e1 * period_s_ * E;
  if (wanted.squares)
    polynomial(first_, q, part.derivative, whole.derivative * e1 + whole.value * rest_s_ * e1,
               square, out.squared);
  if (!wanted.delay) return;
  polynomial(first_, q, -e1, -e1 * lambda * whole.value, 0.0, out.simple_delay);
  if (!wanted.squares) return;
  // d/dlambda of simple_delay
  const Complex slope = rest_s_ * lambda * whole.value + whole.value + lambda * whole.derivative;
  polynomial(first_, q, -e1 * rest_s_, -e1 * slope, -lambda * square, out.squared_delay);
}

}  // namespace stageid
