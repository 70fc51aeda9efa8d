#include "frf/experiment_noise_check.hpp"

#include <fmt/format.h>

namespace stageid {

std::vector<Finding> check_experiment_noise(const FrfEstimate& frf) {
  if (!(frf.experiment_noise_ratio > 1.0)) return {};
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::uneven_noise;
  finding.what =
      "the noise differs between the experiments: each has its own variance, with fewer degrees of "
      "freedom than a common one";
  finding.figure = fmt::format("up to {:.2g} times the power; {:.2g} degrees of freedom are left",
                               frf.experiment_noise_ratio, frf.noise_dof);
  finding.remedy =
      "look for what ran during some of them; 'fit --weighting likelihood' takes the nearest "
      "covariance that is common to all";
  return {finding};
}

}  // namespace stageid
