#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid {

/// Finds sensors whose converters cause what looks like nonlinearity of the plant. A sample read in steps q has an error
/// of variance q^2 / 12, here white over the lines of a period of n samples. Above the noise, it repeats with the period,
/// so that only realizations differ. Over M realizations with inputs U (n_u x experiments), its share of the total
/// variance of G_yu is
///   q^2 / (12 n M) [(U U^H)^-1]_uu,
/// and twice that where only odd lines are excited, because the steps are odd, too.
/// One finding per sensor if in every output that tests nonlinear at least a quarter of that excess of the total
/// variance over the noise, on average over lines and inputs, comes from the steps. Source of the error's variance:
/// B. Widrow and I. Kollar, Quantization Noise (2008), chapter 5.
std::vector<Finding> check_sensor_steps(const FrfEstimate& frf, const HealthRecord& record);

}  // namespace stageid
