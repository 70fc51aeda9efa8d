#include "estimation/tracking/forgetting_filter.hpp"

#include <cmath>
#include <utility>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid {

ForgettingFilter::ForgettingFilter(Eigen::MatrixXd prior, double forgetting)
    : prior_(std::move(prior)),
      forgetting_(forgetting),
      information_(Eigen::MatrixXd::Zero(prior_.rows(), prior_.cols())),
      scatter_(information_),
      x_(Eigen::VectorXd::Zero(prior_.rows())) {}

void ForgettingFilter::add(const Eigen::MatrixXd& A, const Eigen::MatrixXd& K,
                           const Eigen::VectorXd& gradient, int periods) {
  const double kept = std::pow(forgetting_, periods);
  information_ = kept * information_ + periods * A;
  scatter_ = kept * kept * scatter_ + periods * K;
  x_ += solve_symmetric(information(), gradient - (1.0 - kept) * (prior_ * x_));
}

void ForgettingFilter::forget() {
  information_.setZero();
  scatter_.setZero();
  x_.setZero();
}

Eigen::MatrixXd ForgettingFilter::covariance() const {
  const Eigen::MatrixXd half = solve_symmetric(information(), scatter_ + prior_);
  return solve_symmetric(information(), half.transpose());
}

}  // namespace stageid
