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

}  // namespace stageid
