#pragma once

#include <Eigen/Core>

#include "frf/plant/plant_frf.hpp"
#include "tests/support/stages/sampled_loop.hpp"

/// One loop measured from rest again and again, with other noise.
namespace stageid::test {

struct Trials {
  double error = 0.0;        ///< rms over seeds and lines of |G - truth| / |truth|
  double over_stated = 0.0;  ///< mean over entries of (empirical / reported variance)
  double bias = 0.0;         ///< mean over entries of |mean error|^2 over its variance
  double residual = 0.0;     ///< mean over seeds, lines and outputs of C_E's diagonal
};

Trials repeat(const SampledPlant& plant, LoopExperiment x, double noise_std,
              const FrfOptions& options, int seeds);

/// Mean over lines and entries of |G - truth|^2 over the stated variance; 1 if the variance is right.
double error_over_variance(const FrfEstimate& frf, const SampledPlant& plant);
double error_over(const Eigen::MatrixXd& variance, const FrfEstimate& frf,
                  const SampledPlant& plant);

/// Over the lines, of |G - truth| / |truth|.
double largest_error(const FrfEstimate& frf, const SampledPlant& plant);

}  // namespace stageid::test
