#include "tests/support/models/estimate_trials.hpp"

#include <algorithm>
#include <cmath>

namespace stageid::test {

Trials repeat(const SampledPlant& plant, LoopExperiment x, double noise_std,
              const FrfOptions& options, int seeds) {
  Eigen::MatrixXcd sum;
  Eigen::MatrixXd squares, stated;
  Trials trials;
  for (int seed = 1; seed <= seeds; ++seed) {
    x.seed = static_cast<std::uint64_t>(seed);
    const MemoryLog log = simulate_sampled_log(plant, x, noise_std);
    const FrfEstimate frf = estimate_plant_frf({&log}, options);
    Eigen::MatrixXcd deviation = frf.response;
    for (Eigen::Index k = 0; k < frf.lines(); ++k) {
      const Eigen::MatrixXcd G = plant.response(frf.omega_rad_s()[k], x.sample_rate_hz);
      deviation.col(k) -= G.reshaped();
      trials.error += deviation.col(k).squaredNorm() / G.squaredNorm();
    }
    if (seed == 1) {
      sum = Eigen::MatrixXcd::Zero(frf.response.rows(), frf.lines());
      squares = stated = Eigen::MatrixXd::Zero(frf.response.rows(), frf.lines());
    }
    sum += deviation;
    squares += deviation.cwiseAbs2();
    stated += frf.noise_variance;
    for (Eigen::Index i = 0; i < frf.n_outputs(); ++i)
      trials.residual += frf.residual_covariance.row(i * (frf.n_outputs() + 1)).real().mean() /
                         static_cast<double>(seeds * frf.n_outputs());
  }
  trials.error = std::sqrt(trials.error / (seeds * static_cast<double>(sum.cols())));
  trials.over_stated = (squares.array() / stated.array()).mean();
  trials.bias = (sum.cwiseAbs2().array() / stated.array()).mean();
  return trials;
}

double error_over(const Eigen::MatrixXd& variance, const FrfEstimate& frf,
                  const SampledPlant& plant) {
  double sum = 0.0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd G = plant.response(frf.omega_rad_s()[k], frf.sample_rate_hz);
    sum += ((frf.at(k) - G).reshaped().array().abs2() / variance.col(k).array()).mean();
  }
  return sum / static_cast<double>(frf.lines());
}

double error_over_variance(const FrfEstimate& frf, const SampledPlant& plant) {
  return error_over(frf.noise_variance, frf, plant);
}

double largest_error(const FrfEstimate& frf, const SampledPlant& plant) {
  double largest = 0.0;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd G = plant.response(frf.omega_rad_s()[k], frf.sample_rate_hz);
    largest = std::max(largest, (frf.at(k) - G).norm() / G.norm());
  }
  return largest;
}

}  // namespace stageid::test
