#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test {

/// What a fit found, and the deviations that it reports.
struct Observed {
  Eigen::VectorXd value;
  Eigen::VectorXd deviation;
};

/// Frequencies and damping ratios of the modes, then all numerators.
inline Observed model_quantities(const FitResult& fit) {
  std::vector<double> value;
  std::vector<double> deviation;
  for (const Submodel& s : fit.model.submodels)
    if (s.is_mode()) {
      value.insert(value.end(), {s.natural_frequency_hz(), s.damping_ratio()});
      deviation.insert(deviation.end(),
                       {s.natural_frequency_std_hz.value(), s.damping_ratio_std.value()});
    }
  for (const Submodel& s : fit.model.submodels) {
    value.insert(value.end(), s.numerator[0].data(), s.numerator[0].data() + s.numerator[0].size());
    const Eigen::MatrixXd& of_B = s.numerator_std.at(0);
    deviation.insert(deviation.end(), of_B.data(), of_B.data() + of_B.size());
  }
  const auto vector = [](const std::vector<double>& all) -> Eigen::VectorXd {
    return Eigen::Map<const Eigen::VectorXd>(all.data(), std::ssize(all));
  };
  return {vector(value), vector(deviation)};
}

struct RepeatedFits {
  Eigen::ArrayXd mean;
  Eigen::ArrayXd scatter;   ///< variances
  Eigen::ArrayXd reported;  ///< mean of the reported ones
  Eigen::ArrayXXd
      response_ratio;  ///< channels x runs: |error|^2 over its reported mean, over lines

  double mean_response_ratio() const { return response_ratio.mean(); }
  /// Standard error of the mean.
  double response_ratio_error() const {
    return std::sqrt(scatter_of(response_ratio.colwise().mean().matrix())[0] /
                     static_cast<double>(response_ratio.cols()));
  }
};

/// Fits of repeated measurements that start from the truth. @param observed called in the order of the runs
inline RepeatedFits repeat_fits(
    const DenseProblem& problem, FitOptions options,
    const std::function<FrfEstimate(std::uint64_t run)>& measured,
    const std::function<Observed(const FrfEstimate&, FitResult&)>& observed =
        [](const FrfEstimate&, const FitResult& fit) { return model_quantities(fit); },
    Eigen::Index runs = kRuns) {
  options.threads = 1;
  RepeatedFits out;
  Eigen::MatrixXd values;
  out.response_ratio.resize(problem.channels(), runs);
  for (Eigen::Index run = 0; run < runs; ++run) {
    const FrfEstimate frf = measured(static_cast<std::uint64_t>(run));
    FitResult fit = fit_additive_model(frf, problem.model, options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    const Eigen::MatrixXcd error =
        reference_response(fit.model, problem.frequency_hz, problem.hold) - problem.G;
    out.response_ratio.col(run) =
        error.cwiseAbs2().cwiseQuotient(fit.response_variance).rowwise().mean();
    const auto [value, deviation] = observed(frf, fit);
    if (run == 0) values.resize(value.size(), runs);
    if (run == 0) out.reported.setZero(value.size());
    values.col(run) = value;
    out.reported += deviation.array().square() / static_cast<double>(runs);
  }
  out.mean = values.rowwise().mean();
  out.scatter = scatter_of(values);
  return out;
}

}  // namespace stageid::test
