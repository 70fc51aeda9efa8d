#include "estimation/tracking/tracking_reference.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cmath>
#include <complex>
#include <utility>

namespace stageid {
namespace {

/// The spectra of a linear and of a quadratic trend of every output, n_y N x 2 n_y.
Eigen::MatrixXcd spectra_of_trends(const TrackedResponse& response) {
  const Eigen::Index N = response.lines();
  const Eigen::Index n_y = response.model().n_outputs();
  Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(n_y * N, 2 * n_y);
  for (Eigen::Index k = 0; k < N; ++k) {
    const double turn = response.omega_rad_s()[k] / response.model().sample_rate_hz;
    const std::complex<double> sum = 1.0 / (1.0 - std::polar(1.0, -turn));
    for (Eigen::Index i = 0; i < n_y; ++i) {
      out(k * n_y + i, i) = sum;
      out(k * n_y + i, n_y + i) = sum * sum;
    }
  }
  return out;
}

}  // namespace

PeriodSpectra mean_of(const std::deque<PeriodSpectra>& periods, std::size_t last) {
  PeriodSpectra mean = periods.back();
  for (std::size_t i = periods.size() - last; i + 1 < periods.size(); ++i) {
    mean.Y += periods[i].Y;
    mean.U += periods[i].U;
  }
  mean.Y /= static_cast<double>(last);
  mean.U /= static_cast<double>(last);
  return mean;
}

TrackingReference::TrackingReference(const TrackedResponse& response,
                                     const std::deque<PeriodSpectra>& periods, Eigen::VectorXd x,
                                     bool settle)
    : response_(response),
      periods_(static_cast<double>(periods.size())),
      x_(std::move(x)),
      P_(response.at(x_)),
      trends_(spectra_of_trends(response)) {
  const PeriodSpectra mean = mean_of(periods, periods.size());
  std::vector<Eigen::MatrixXcd> residuals = learn_noise(periods);
  if (settle) {
    this->settle(mean);
    P_ = response.at(x_);
    residuals = learn_noise(periods);  // with feedback, it depends on P
  }
  linearize(mean.U);
  const SumCovariance sums = noise_->covariance(J_);
  // An estimate over a deviation from nu degrees of freedom has the mean square nu / (nu - 2).
  const Eigen::ArrayXd wider =
      (sums.freedom.array() / (sums.freedom.array() - 2.0).max(1.0)).sqrt();
  K_ = wider.matrix().asDiagonal() * sums.value * wider.matrix().asDiagonal();
  freedom_ = sums.freedom;
  residual_ = residual(mean, P_);
  gradient_ = gradient(residual_);
  learn_noise_power(residuals);
  judge(mean);
}

Eigen::MatrixXcd TrackingReference::raw_residual(const PeriodSpectra& period,
                                                 const Eigen::MatrixXcd& P) const {
  return period.Y - TrackedResponse::outputs(P, period.U);
}

Eigen::VectorXd TrackingReference::whitened(const Eigen::MatrixXcd& of) const {
  return noise_->whitened(of.reshaped());
}

void TrackingReference::remove_trends(Eigen::MatrixXcd& of) const {
  const Eigen::VectorXd size = white_trends_.householderQr().solve(whitened(of));
  of.reshaped() -= trends_ * size;
}

Eigen::MatrixXcd TrackingReference::residual(const PeriodSpectra& period,
                                             const Eigen::MatrixXcd& P) const {
  Eigen::MatrixXcd out = raw_residual(period, P);
  remove_trends(out);
  return out;
}

Eigen::VectorXd TrackingReference::gradient(const Eigen::MatrixXcd& residual) const {
  return J_.transpose() * whitened(residual);
}

Eigen::VectorXd TrackingReference::noise_power(const Eigen::MatrixXcd& difference) const {
  return noise_->relative_power(difference);
}

Eigen::VectorXd TrackingReference::whitened_change(const Eigen::MatrixXcd& of) const {
  const Eigen::VectorXd white = whitened(of);
  return white - trend_basis_ * (trend_basis_.transpose() * white);
}

Eigen::VectorXd TrackingReference::whitened_change(const PeriodSpectra& mean) const {
  return whitened_change(raw_residual(mean, P_) - residual_);
}

/// The noise and the trends at P. @returns the residuals without trends
std::vector<Eigen::MatrixXcd> TrackingReference::learn_noise(
    const std::deque<PeriodSpectra>& periods) {
  std::vector<Eigen::MatrixXcd> residuals;
  for (const PeriodSpectra& period : periods) residuals.push_back(raw_residual(period, P_));
  noise_.emplace(residuals);
  // The noise on top of the trends gives the weights to remove them.
  for (int pass = 0; pass < 2; ++pass) {
    white_trends_ = noise_->whitened(trends_);
    for (Eigen::MatrixXcd& r : residuals) remove_trends(r);
    noise_.emplace(residuals);
  }
  white_trends_ = noise_->whitened(trends_);
  trend_basis_ = white_trends_.householderQr().householderQ() *
                 Eigen::MatrixXd::Identity(white_trends_.rows(), white_trends_.cols());
  return residuals;
}

void TrackingReference::linearize(const Eigen::MatrixXcd& U) {
  J_ = noise_->whitened(response_.derivatives(x_, U));
  J_ -= trend_basis_ * (trend_basis_.transpose() * J_);
  A_ = J_.transpose() * J_;
}

/// Gauss-Newton from x to the mean of the learned periods.
void TrackingReference::settle(const PeriodSpectra& mean) {
  const Eigen::MatrixXd prior =
      prior_information(response_.parameters(), response_.model().sample_rate_hz);
  const auto cost = [&](const Eigen::VectorXd& at) {
    return periods_ * whitened(raw_residual(mean, response_.at(at))).squaredNorm() +
           at.dot(prior * at);
  };
  double now = cost(x_);
  for (int iteration = 0; iteration < 20; ++iteration) {
    linearize(mean.U);
    const Eigen::VectorXd step =
        Eigen::LDLT<Eigen::MatrixXd>(periods_ * A_ + prior)
            .solve(periods_ * gradient(raw_residual(mean, response_.at(x_))) - prior * x_);
    double length = 1.0;
    double next = cost(x_ + step);
    while (!(next < now) && length > 1e-3) {
      length *= 0.5;
      next = cost(x_ + length * step);
    }
    if (!(next < now)) break;
    x_ += length * step;
    const bool small = now - next < 1e-3;  // of a chi-square
    now = next;
    if (small) break;
  }
}

/// From successive differences.
void TrackingReference::learn_noise_power(const std::vector<Eigen::MatrixXcd>& residuals) {
  Eigen::ArrayXXd power(residual_.rows(), std::ssize(residuals) - 1);
  for (Eigen::Index t = 0; t < power.cols(); ++t)
    power.col(t) = noise_power(residuals[static_cast<std::size_t>(t + 1)] -
                               residuals[static_cast<std::size_t>(t)]);
  const Eigen::ArrayXd mean = power.rowwise().mean();
  const Eigen::ArrayXd scatter = (power.colwise() - mean).square().rowwise().mean();
  // At least that of independent lines; 1.5 times over many periods, because neighbours share one.
  noise_deviation_ = (1.5 * scatter.max(1.0 / static_cast<double>(residual_.cols()))).sqrt();
}

void TrackingReference::judge(const PeriodSpectra& mean) {
  const Eigen::Index n_y = residual_.rows();
  const Eigen::VectorXd white = whitened(residual_);
  const Eigen::MatrixXd squares = white.cwiseAbs2().reshaped(n_y, white.size() / n_y);
  quality_.chi_square = periods_ * squares.rowwise().mean();
  const Eigen::ArrayXd excess = residual_.rowwise().squaredNorm().array() *
                                (1.0 - 1.0 / quality_.chi_square.array().max(1.0));
  quality_.relative_error = (excess / mean.Y.rowwise().squaredNorm().array()).sqrt();
}

}  // namespace stageid
