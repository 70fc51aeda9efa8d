// What happens when a measurement with correlated noise is repeated.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/search/fit_additive_model.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/delayed_fit_options.hpp"

namespace stageid::test_likelihood_monte_carlo {

using test::kRuns;
using test::Measurement;
using test::options_with;

/// Scatter of frequencies and damping ratios over runs, the reported deviations, and the error of the response.
struct Repeated {
  Eigen::VectorXd scatter = Eigen::VectorXd::Zero(6);
  Eigen::VectorXd reported = Eigen::VectorXd::Zero(6);
  Eigen::VectorXd bias = Eigen::VectorXd::Zero(6);
  double response_ratio = 0.0;
};

Repeated repeat(Weighting weighting, int dof) {
  Repeated out;
  FitOptions options = options_with(weighting);
  options.threads = 1;
  Eigen::MatrixXd values(6, kRuns);
  Eigen::VectorXd truth(6);
  for (int run = 0; run < kRuns; ++run) {
    const Measurement m(static_cast<std::uint64_t>(1000 + run), dof);
    const FitResult fit = fit_additive_model(m.frf, m.problem.model, options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    for (Eigen::Index i = 0; i < 3; ++i) {
      const auto at = static_cast<std::size_t>(i) + 1;
      const Submodel& s = fit.model.submodels[at];
      values.col(run).segment<2>(2 * i) << s.natural_frequency_hz(), s.damping_ratio();
      out.reported[2 * i] += std::pow(*s.natural_frequency_std_hz, 2) / kRuns;
      out.reported[2 * i + 1] += std::pow(*s.damping_ratio_std, 2) / kRuns;
      truth.segment<2>(2 * i) << m.problem.model.submodels[at].natural_frequency_hz(),
          m.problem.model.submodels[at].damping_ratio();
    }
    const Eigen::MatrixXcd error =
        test::reference_response(fit.model, m.problem.frequency_hz, m.problem.hold) - m.problem.G;
    out.response_ratio += error.cwiseAbs2().cwiseQuotient(fit.response_variance).mean() / kRuns;
  }
  const Eigen::VectorXd mean = values.rowwise().mean();
  out.scatter = test::scatter_of(values);
  out.bias = (mean - truth).cwiseAbs();
  return out;
}

TEST(LikelihoodMonteCarlo, ScattersLessThanDiagonalWeightsAndAsMuchAsItSays) {
  for (const int dof : {0, 2}) {
    const Repeated likelihood = repeat(Weighting::likelihood, dof);
    const Repeated diagonal = repeat(Weighting::noise_variance, dof);
    test::expect_honest(likelihood.scatter, likelihood.reported);
    for (Eigen::Index q = 0; q < 6; ++q) {
      EXPECT_LT(likelihood.bias[q], 4.0 * std::sqrt(likelihood.reported[q] / kRuns)) << q;
      // Half the standard deviation at most: far outside what 150 runs leave open.
      EXPECT_LT(likelihood.scatter[q], 0.25 * diagonal.scatter[q]) << dof << ", " << q;
    }
    // Gauss-Markov: the band's variance is an upper bound, here of correlations that turn.
    EXPECT_LT(likelihood.response_ratio, 1.05) << dof;
    EXPECT_GT(likelihood.response_ratio, 0.5) << dof;
  }
}

}  // namespace stageid::test_likelihood_monte_carlo
