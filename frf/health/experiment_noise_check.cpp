#include "frf/health/experiment_noise_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "frf/health/health_measures.hpp"

namespace stageid {
namespace {

/// "realization 1, experiment 2: 9.8 times ...; ", the largest difference first.
std::string named(std::vector<NoisyRun> runs) {
  std::stable_sort(runs.begin(), runs.end(), [](const NoisyRun& a, const NoisyRun& b) {
    return std::abs(std::log(a.ratio)) > std::abs(std::log(b.ratio));
  });
  std::string text;
  for (std::size_t i = 0; i < std::min(runs.size(), kMostNamed); ++i)
    text +=
        fmt::format("realization {}, experiment {}: {:.2g} times the power of the others on {}; ",
                    runs[i].realization + 1, runs[i].experiment + 1, runs[i].ratio, runs[i].output);
  if (runs.size() > kMostNamed) text += fmt::format("{} more; ", runs.size() - kMostNamed);
  return text;
}

// Times the noise power of the others. Disturbances of a stage rarely reach it; a limit cycle stops at one run and not
// at the next.
constexpr double kLimitCycle = 100.0;

bool mostly_unsettled(const NonlinearityTest& test) {
  Eigen::Index unsettled = 0;
  for (Eigen::Index b = 0; b < test.settled_p_value.size(); ++b)
    unsettled += test.settled(b) ? 0 : 1;
  return 2 * unsettled > test.settled_p_value.size();
}

}  // namespace

std::vector<Finding> check_experiment_noise(const FrfEstimate& frf,
                                            const std::vector<NoisyRun>& runs) {
  if (!(frf.experiment_noise_ratio > 1.0)) return {};
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::uneven_noise;
  finding.what =
      "the noise level differs between the experiments: each has its own variance, with fewer "
      "degrees of freedom than a common variance";
  finding.figure =
      named(runs) + fmt::format("up to {:.2g} times the power; {:.2g} degrees of freedom remain",
                                frf.experiment_noise_ratio, frf.noise_dof);
  finding.remedy =
      "find out what disturbed these experiments; 'fit --weighting likelihood' uses the nearest "
      "common covariance";
  // Noise has random phases on neighbouring lines, a limit cycle has not.
  if (frf.experiment_noise_ratio > kLimitCycle && mostly_unsettled(frf.nonlinearity)) {
    finding.severity = Severity::fault;
    finding.cause = Cause::limit_cycle;
    finding.what =
        "the loop oscillates by itself in some experiments: a limit cycle, as coarse steps of the "
        "command or friction cause";
    finding.remedy = kRemedyOfLimitCycle;
  }
  return {finding};
}

}  // namespace stageid
