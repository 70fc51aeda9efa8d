#pragma once

#include <optional>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// What is wrong in time: lost samples, inputs that do not repeat, an excitation recorded late (put right in
/// `record`), a response that changes. First, since it explains what other checks would blame channels for.
std::vector<Finding> check_timing(HealthRecord& record, const std::optional<NominalStage>& nominal);

}  // namespace stageid
