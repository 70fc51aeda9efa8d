#pragma once

#include <optional>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// Checks the timing: lost samples, inputs that do not repeat, an excitation recorded late (corrected in `record`), a
/// response that changes. Runs first, because such errors would otherwise be attributed to channels.
std::vector<Finding> check_timing(HealthRecord& record, const std::optional<NominalStage>& nominal);

/// Checks whether the inputs repeat with the declared period. Needs no stage.
///
/// On an excited line, the excited actuators, each relative to its excitation, have the mean m over P periods and the
/// variance s^2 between periods. The line does not repeat if |m|^2 is below both (1 + 1/P) s^2, one period's noise,
/// and 4 s^2 / P, hardly more than the noise of the mean. If more than half of the lines of every experiment do not
/// repeat, noise is not the cause: the period or the excitation of the log is wrong. At most one finding, cause
/// `aperiodic`.
std::vector<Finding> check_repetition(const HealthRecord& record);

}  // namespace stageid
