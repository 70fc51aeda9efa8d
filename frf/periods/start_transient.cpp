#include "frf/periods/start_transient.hpp"

#include <algorithm>
#include <utility>

#include "frf/statistics/distributions.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {

StartRecorder::StartRecorder(Eigen::MatrixXcd start)
    : on_(true), start_used_(start.size() == 0), start_(std::move(start)) {}

void StartRecorder::take(const Eigen::Ref<const Eigen::MatrixXcd>& spectra) {
  if (!on_) return;
  if (start_.size() == 0) {
    start_ = spectra;
    return;
  }
  ++count_;
  before_latest_ = std::move(latest_);
  latest_ = spectra;
  if (count_ == 1) {
    first_ = spectra;
    rest_mean_.setZero(spectra.rows(), spectra.cols());
    return;
  }
  rest_mean_ += (spectra - rest_mean_) / (count_ - 1);
}

RunStart StartRecorder::finish() {
  RunStart run;
  if (!on_ || count_ < 2) return run;
  on_ = false;
  const double P = count_;
  const Eigen::MatrixXcd mean = (first_ + (P - 1.0) * rest_mean_) / P;
  const Eigen::MatrixXcd B = start_ - mean;
  const Eigen::MatrixXcd W = first_ - rest_mean_;
  // Both against the same periods, so that time can be reversed.
  const Eigen::MatrixXcd inner = ((P - 1.0) * rest_mean_ - latest_) / std::max(1.0, P - 2.0);
  const Eigen::MatrixXcd first = first_ - inner;
  const Eigen::MatrixXcd last = latest_ - inner;
  const Eigen::MatrixXcd V = before_latest_ - latest_;
  // The last two periods contain least of the start.
  const Eigen::MatrixXd noise = 0.5 * V.cwiseAbs2();
  // One scale per sensor makes the units comparable and keeps the colour over the lines.
  for (Eigen::Index c = 0; c < noise.rows(); ++c) {
    const Eigen::VectorXd of_sensor = noise.row(c);
    std::vector<double> values(of_sensor.begin(), of_sensor.end());
    const double power = mean.row(c).squaredNorm() / static_cast<double>(mean.cols());
    const double level = std::max(order_statistic(values, 0.5), kPowerRounding * power);
    const double weight = level > 0.0 ? 1.0 / level : 0.0;
    if (c == 0) {
      run.along = run.ending = Eigen::VectorXcd::Zero(noise.cols());
      run.start = run.first = run.last = run.noise = Eigen::VectorXd::Zero(noise.cols());
    }
    run.along += weight * B.row(c).conjugate().cwiseProduct(W.row(c)).transpose();
    run.ending += weight * B.row(c).conjugate().cwiseProduct(V.row(c)).transpose();
    run.start += weight * B.row(c).cwiseAbs2().transpose();
    run.first += weight * first.row(c).cwiseAbs2().transpose();
    run.last += weight * last.row(c).cwiseAbs2().transpose();
    // Rounding errors count as noise, so that it is not zero.
    run.noise.array() +=
        weight * noise.row(c).transpose().array() + weight * kPowerRounding * power;
  }
  run.periods = count_;
  run.start_used = start_used_;
  return run;
}

}  // namespace stageid
