#pragma once

#include <optional>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// Checks a log before a fit: one finding per cause, faults first.
///
/// - Timing (timing_check.hpp): lost samples, a late excitation, a response that changes.
/// - Samples: dead and clipped channels, marked and late cycles.
/// - Spectra: channels without response, cond(R), cond(U), actuators that move outside the sub-plant.
/// - With the configuration: whether u = r - C y holds between the recorded signals (recorded_channels_check.hpp:
///   names, signs, scales and timing of the recording), then whether the rigid body has the configured geometry
///   and mass (stage_wiring_check.hpp: wiring behind the recorder).
/// What this log cannot show is a finding of severity `unchecked` that names the missing data.
///
/// The comment of each check states its rate of false alarms. health_study measures them over random
/// stages (docs/benchmarks.md).
std::vector<Finding> check_health(HealthRecord record, const std::optional<NominalStage>& nominal);

}  // namespace stageid
