#pragma once

#include <optional>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// What is wrong with a log, before anyone fits: one finding a cause, faults first.
///
/// In time (timing_check.hpp): lost samples, a late excitation, a response that changes. From the samples: dead and
/// clipped channels, marked and late cycles. From the spectra: channels
/// without response, cond(R), cond(U), actuators that move beside the sub-plant. With the configuration: whether
/// u = r - C y holds between the recorded signals (controller_check.hpp: names, signs, scales and
/// timing of the recording), then whether the rigid body is that of geometry and mass
/// (rigid_body_check.hpp: the wires behind the recording). What cannot be seen from
/// this log is a finding of severity `unchecked` that names what is needed.
///
/// Every check states its own rate of false alarms; what matters is measured over random stages by
/// health_study (docs/benchmarks.md).
std::vector<Finding> check_health(HealthRecord record, const std::optional<NominalStage>& nominal);

}  // namespace stageid
