#include "estimation/start/stabilization.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

// keeps the Toeplitz matrix definite if there are gaps between the lines
constexpr double kShift = 1e-12;
constexpr double kMostDamping = 0.2;
constexpr double kFrequencyTolerance = 0.01;  // relative to the previous order
constexpr double kDampingTolerance = 0.05;

/// Sums over the lines by lag l = row - column of powers of z^-1, from which the equations are composed.
class NormalMatrix {
 public:
  NormalMatrix(const FrfEstimate& frf, const StabilizationOptions& options)
      : order_(options.most_order), step_s_(0.5 / frf.frequency_hz.maxCoeff()) {
    const Eigen::VectorXd omega = frf.omega_rad_s();
    const Eigen::VectorXcd delay =
        (Complex(0.0, options.delay_s) * omega.cast<Complex>()).array().exp().matrix();
    const Eigen::VectorXd squares =
        omega.array().pow(4).matrix();  // w^2 without the scale of the channel
    const Eigen::MatrixXd lags = Eigen::RowVectorXd::LinSpaced(2 * order_ + 1, -order_, order_);
    const Eigen::MatrixXd angle = step_s_ * omega * lags;  // N x lags
    const Eigen::MatrixXd cosine = angle.array().cos().matrix();
    const Eigen::MatrixXd sine = angle.array().sin().matrix();

    const Eigen::VectorXd own = cosine.transpose() * squares;
    Eigen::MatrixXd R = toeplitz(own);
    R.diagonal().array() += kShift * own[order_];
    const Eigen::LLT<Eigen::MatrixXd> factor(R);

    Eigen::VectorXd both = Eigen::VectorXd::Zero(omega.size());
    matrix_ = Eigen::MatrixXd::Zero(order_ + 1, order_ + 1);
    for (Eigen::Index c = 0; c < frf.response.rows(); ++c) {
      const Eigen::VectorXcd H = frf.response.row(c).transpose().cwiseProduct(delay);
      const Eigen::VectorXd power = squares.cwiseProduct(H.cwiseAbs2());
      const double scale = 1.0 / std::max(power.mean(), 1e-300);
      both += scale * power;
      // Re{H e^{-j omega T l}} = Re H cos + Im H sin
      const Eigen::VectorXd mixed = cosine.transpose() * squares.cwiseProduct(H.real()) +
                                    sine.transpose() * squares.cwiseProduct(H.imag());
      Eigen::MatrixXd S = toeplitz(mixed);
      factor.matrixL().solveInPlace(S);
      matrix_.noalias() -= scale * (S.transpose() * S);
    }
    matrix_ += toeplitz(cosine.transpose() * both);
  }

  /// The denominator d_0 ... d_n of the given order with d_n = 1.
  Eigen::VectorXd denominator(int order) const {
    Eigen::VectorXd d(order + 1);
    d << matrix_.topLeftCorner(order, order).ldlt().solve(-matrix_.col(order).head(order)), 1.0;
    return d;
  }

  double step_s() const noexcept { return step_s_; }

 private:
  /// Entry (row, column) is the lag column - row.
  Eigen::MatrixXd toeplitz(const Eigen::VectorXd& by_lag) const {
    Eigen::MatrixXd out(order_ + 1, order_ + 1);
    for (Eigen::Index row = 0; row <= order_; ++row)
      out.row(row) = by_lag.segment(order_ - row, order_ + 1).transpose();
    return out;
  }

  int order_;
  double step_s_;
  Eigen::MatrixXd matrix_;
};

/// Zeros in z of d_0 z^n + ... + d_n.
Eigen::VectorXcd zeros(const Eigen::VectorXd& d) {
  const Eigen::Index n = d.size() - 1;
  if (d[0] == 0.0 || !d.allFinite()) return {};
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(n, n);
  companion.row(0) = -d.tail(n).transpose() / d[0];
  companion.diagonal(-1).setOnes();
  return eigenvalues(companion);
}

void compare(StabilizationPole& pole, const std::vector<StabilizationPole>& before) {
  const auto apart = [&](const StabilizationPole& other) {
    return std::abs(other.frequency_hz / pole.frequency_hz - 1.0);
  };
  const auto nearest = std::ranges::min_element(before, {}, apart);
  if (nearest == before.end()) return;
  pole.stable_frequency = apart(*nearest) <= kFrequencyTolerance;
  pole.stable_damping =
      pole.stable_frequency &&
      std::abs(nearest->damping_ratio / pole.damping_ratio - 1.0) <= kDampingTolerance;
}

}  // namespace

std::vector<StabilizationPole> stabilization(const FrfEstimate& frf,
                                             const StabilizationOptions& options) {
  if (options.most_order < 2 || Eigen::Index{2} * options.most_order >= frf.lines())
    fail_request(
        "stabilization: most_order {} is out of range for {} lines; give 2 to less "
        "than half of the lines",
        options.most_order, frf.lines());
  const NormalMatrix normal(frf, options);
  std::vector<StabilizationPole> all;
  std::vector<StabilizationPole> before;
  for (int order = 2; order <= options.most_order; order += 2) {
    std::vector<StabilizationPole> found;
    for (const Complex z : zeros(normal.denominator(order))) {
      const Complex s = std::log(z) / normal.step_s();
      const double f = std::abs(s) / (2.0 * std::numbers::pi);
      const double damping = -s.real() / std::abs(s);
      if (!(s.imag() > 0.0) || !(damping > 0.0) || damping > kMostDamping) continue;
      if (f < frf.frequency_hz[0] || f > frf.frequency_hz[frf.lines() - 1]) continue;
      found.push_back({.order = order, .frequency_hz = f, .damping_ratio = damping});
      compare(found.back(), before);
    }
    std::ranges::sort(found, {}, &StabilizationPole::frequency_hz);
    all.insert(all.end(), found.begin(), found.end());
    before = std::move(found);
  }
  return all;
}

}  // namespace stageid
