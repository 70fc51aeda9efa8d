#include "estimation/tracking/tracking_reference.hpp"

#include <cmath>
#include <utility>

#include "estimation/tracking/free_motion.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

/// A mode moves if its free motion has this times the power of noise alone, while the stage is learned.
constexpr double kMoves = 2.0;

Eigen::MatrixXd basis_of(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& factors) {
  return leading_columns(factors, factors.rank());
}

template <typename Matrix>
void append(Matrix& to, const Matrix& columns) {
  to.conservativeResize(Eigen::NoChange, to.cols() + columns.cols());
  to.rightCols(columns.cols()) = columns;
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
                                     const ForgettingFilter& before)
    : response_(response),
      periods_(static_cast<double>(periods.size())),
      x_(std::move(x)),
      P_(response.at(x_)),
      all_motions_(free_motions(response)) {
  const PeriodSpectra mean = mean_of(periods, periods.size());
  learn_noise(periods);
  settle(mean, before);
  P_ = response.at(x_);
  const std::vector<Eigen::MatrixXcd> residuals = learn_noise(periods);  // in a loop, depends on P
  linearize(mean.U);
  const SumCovariance sums = noise_->covariance(J_);
  // An estimate over a deviation from nu degrees of freedom has the mean square nu / (nu - 2).
  const Eigen::ArrayXd wider =
      (sums.freedom.array() / (sums.freedom.array() - 2.0).max(1.0)).sqrt();
  K_ = wider.matrix().asDiagonal() * sums.value * wider.matrix().asDiagonal();
  freedom_ = sums.freedom;
  residual_ = residual(mean, P_);
  gradient_ = gradient(residual_);
  double power = 0.0;
  for (const PeriodSpectra& period : periods) power += motion_power(period, P_) / (periods_ - 1.0);
  if (power > 0.0) other_power_ = power;
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

void TrackingReference::remove_motions(Eigen::MatrixXcd& of) const {
  of.reshaped() -= motions_ * least_squares(white_motions_, whitened(of));
}

Eigen::MatrixXd TrackingReference::beside_motions(const Eigen::MatrixXd& white) const {
  return white - motion_basis_ * (motion_basis_.transpose() * white);
}

Eigen::MatrixXcd TrackingReference::residual(const PeriodSpectra& period,
                                             const Eigen::MatrixXcd& P) const {
  Eigen::MatrixXcd out = raw_residual(period, P);
  remove_motions(out);
  return out;
}

Eigen::VectorXd TrackingReference::gradient(const Eigen::MatrixXcd& residual) const {
  return J_.transpose() * whitened(residual);
}

Eigen::VectorXd TrackingReference::noise_power(const Eigen::MatrixXcd& difference) const {
  return noise_->relative_power(difference);
}

Eigen::VectorXd TrackingReference::whitened_change(const Eigen::MatrixXcd& of) const {
  return beside_motions(whitened(of));
}

Eigen::VectorXd TrackingReference::whitened_change(const PeriodSpectra& mean) const {
  return whitened_change(raw_residual(mean, P_) - residual_);
}

/// The noise beside these motions. @returns the residuals without them
std::vector<Eigen::MatrixXcd> TrackingReference::learn_beside(
    Eigen::MatrixXcd motions, std::vector<Eigen::MatrixXcd> residuals) {
  motions_ = std::move(motions);
  // The noise beside the motions gives the weights to remove them.
  for (int pass = 0; pass < 2; ++pass) {
    white_motions_ = pivoted_qr(noise_->whitened(motions_));
    for (Eigen::MatrixXcd& r : residuals) remove_motions(r);
    noise_.emplace(residuals);
  }
  white_motions_ = pivoted_qr(noise_->whitened(motions_));
  motion_basis_ = basis_of(white_motions_);
  return residuals;
}

/// Adds those of the modes that move: their lines are correlated with each other, those of noise are not.
/// @param residuals without motions_   @returns those of the other modes
Eigen::MatrixXcd TrackingReference::add_motions(const std::vector<Eigen::MatrixXcd>& residuals) {
  Eigen::MatrixXd scatter(motion_basis_.rows(), std::ssize(residuals));
  for (Eigen::Index t = 0; t < scatter.cols(); ++t) scatter.col(t) = whitened(residuals[t]);
  scatter.colwise() -= scatter.rowwise().mean().eval();
  Eigen::MatrixXcd others(motions_.rows(), 0);
  for (std::size_t i = 1; i < all_motions_.size(); ++i) {
    const Eigen::MatrixXd white = beside_motions(noise_->whitened(all_motions_[i]));
    const Eigen::MatrixXd basis = basis_of(pivoted_qr(white));
    const Eigen::MatrixXd part = basis.transpose() * scatter;
    const double chance = (periods_ - 1.0) * static_cast<double>(basis.cols());
    const bool moves = part.squaredNorm() > kMoves * chance;
    append(moves ? motions_ : others, all_motions_[i]);
    if (!moves) continue;
    scatter -= basis * part;
    append(motion_basis_, basis);
  }
  return others;
}

/// The noise at P. @returns the residuals without free motions
std::vector<Eigen::MatrixXcd> TrackingReference::learn_noise(
    const std::deque<PeriodSpectra>& periods) {
  std::vector<Eigen::MatrixXcd> raw;
  for (const PeriodSpectra& period : periods) raw.push_back(raw_residual(period, P_));
  noise_.emplace(raw);
  const Eigen::MatrixXcd others = add_motions(learn_beside(all_motions_.front(), raw));
  std::vector<Eigen::MatrixXcd> residuals = learn_beside(std::move(motions_), std::move(raw));
  other_basis_ = basis_of(pivoted_qr(beside_motions(noise_->whitened(others))));
  return residuals;
}

double TrackingReference::motion_power(const PeriodSpectra& period,
                                       const Eigen::MatrixXcd& P) const {
  return (other_basis_.transpose() * whitened(raw_residual(period, P) - residual_)).squaredNorm() /
         (motion_freedom() * other_power_);
}

void TrackingReference::linearize(const Eigen::MatrixXcd& U) {
  J_ = beside_motions(noise_->whitened(response_.derivatives(x_, U)));
  A_ = J_.transpose() * J_;
}

/// Gauss-Newton from x.
void TrackingReference::settle(const PeriodSpectra& mean, const ForgettingFilter& before) {
  const Eigen::MatrixXd known = before.information();
  const auto cost = [&](const Eigen::VectorXd& at) {
    const Eigen::VectorXd off = at - before.estimate();
    return periods_ * whitened(raw_residual(mean, response_.at(at))).squaredNorm() +
           off.dot(known * off);
  };
  double now = cost(x_);
  for (int iteration = 0; iteration < 20; ++iteration) {
    linearize(mean.U);
    const Eigen::VectorXd step = solve_symmetric(
        periods_ * A_ + known, periods_ * gradient(raw_residual(mean, response_.at(x_))) -
                                   known * (x_ - before.estimate()));
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
    power.col(t) = noise_power(residuals[t + 1] - residuals[t]);
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
  const Eigen::ArrayXXd noise =
      residual_.cwiseAbs2().array().colwise() / quality_.chi_square.array().max(1.0);
  // Line by line, so that a resonance counts as well as the rigid body, whose response may be a thousand times larger;
  // lines on which noise hides the response count little.
  const Eigen::ArrayXXd power = mean.Y.cwiseAbs2().array() + noise;
  const Eigen::ArrayXd of_noise = (noise / power).rowwise().sum();
  const Eigen::ArrayXd of_response = (static_cast<double>(noise.cols()) - 2.0 * of_noise).max(1.0);
  // Three standard deviations of the sum over the lines.
  const Eigen::ArrayXd chance = 3.0 / std::sqrt(static_cast<double>(noise.cols())) * of_noise;
  const auto relative = [&](const Eigen::MatrixXcd& e) -> Eigen::VectorXd {
    const Eigen::ArrayXd excess = (e.cwiseAbs2().array() / power).rowwise().sum() - of_noise;
    return (excess > chance).select((excess / of_response).sqrt(), 0.0);
  };
  quality_.relative_error = relative(residual_);
  quality_.model_error = relative(residual(mean, response_.at(Eigen::VectorXd::Zero(x_.size()))));
}

}  // namespace stageid
