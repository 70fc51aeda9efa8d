#include "tools/report/report_uncertainty.hpp"

namespace stageid::report {
namespace {

/// With fewer degrees of freedom (realizations minus one), the standard deviation of a value would itself be uncertain
/// by half, and the band would be ragged.
constexpr double kLeastTotalDof = 4.0;

}  // namespace

Uncertainty uncertainty(const FrfEstimate& frf) {
  const bool scarce = frf.total_dof > 0.0 && frf.total_dof < kLeastTotalDof;
  if (frf.total_variance.size() > 0 && !(scarce && frf.noise_variance.size() > 0))
    return {&frf.total_variance, "total", frf.total_dof};
  if (frf.noise_variance.size() > 0) return {&frf.noise_variance, "noise", frf.noise_dof};
  return {};
}

}  // namespace stageid::report
