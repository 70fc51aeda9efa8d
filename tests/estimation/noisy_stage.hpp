#pragma once

#include <utility>
#include <vector>

#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test {

/// A 2 x 3 stage behind `hold` and, if there is one, 0.137 ms: rigid body, modes {Hz, damping ratio},
/// random numerators. No response yet.
DenseProblem stage_2x3(HoldModel hold, RandomNumbers& random,
                       const std::vector<std::pair<double, double>>& modes);

/// One with two modes 1.5 % apart, and relative noise.
DenseProblem noisy_stage(HoldModel hold, double noise, std::uint64_t seed = 1);

/// For such a stage behind a hold, the delay estimated from the true one.
FitOptions options_with(Weighting weighting);

/// The model as a start: poles moved by these factors, numerators zero.
AdditiveModel moved(const AdditiveModel& model, double frequency_factor, double damping_factor);

/// Repetitions of a measurement, and the bounds of a sample variance over the true one: chi^2 of 149 degrees of freedom
/// over its mean lies in here with 99.99 %, 1 +- 3.9 sqrt(2 / 149) with its skewness (Wilson and Hilferty).
inline constexpr int kRuns = 150;
inline constexpr double kLowestRatio = 0.62;
inline constexpr double kHighestRatio = 1.52;

/// The sample variances of quantities x runs.
Eigen::ArrayXd scatter_of(const Eigen::MatrixXd& values);

void expect_honest(const Eigen::ArrayXd& scatter, const Eigen::ArrayXd& reported);

}  // namespace stageid::test
