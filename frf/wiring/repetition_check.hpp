#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"

namespace stageid {

/// Do the inputs repeat with the declared period? Needs no stage.
///
/// On an excited line the actuators that are excited there, each over its excitation, have the mean m over P
/// periods and the variance s^2 from period to period. The line does not repeat if |m|^2 is below
/// (1 + 1/P) s^2, less than one period's noise, and below 4 s^2 / P, hardly more than noise leaves in the
/// mean. Where more than half of the lines of every experiment do not, it is not the noise: the period, or the
/// excitation, is not what the log says. One finding at most, cause `aperiodic`.
std::vector<Finding> check_repetition(const HealthRecord& record);

}  // namespace stageid
