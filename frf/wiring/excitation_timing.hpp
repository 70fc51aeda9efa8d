#pragma once

#include <optional>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// Delay of the recorded excitation relative to the actuators.
struct ExcitationDelay {
  int samples = 0;      ///< > 0: recorded later than it acted
  double misfit = 0.0;  ///< of u - r + C y, without the shift over with it
  bool certain = true;  ///< false: all actuators may have been recorded early instead
};
Finding to_finding(const ExcitationDelay& delay);

/// Checks whether the excitation was recorded whole samples late or early; if so, corrects `record`.
///
/// With the controller, u + C y is r, and its cross-correlation with the recorded r has its peak at the delay. Without
/// it, u is close to r in the upper half of the band, above the bandwidth of the loop. The misfit is
/// |u + C y - r|^2, every line and axis over |r|^2. The shift is accepted if it lowers the total misfit to a quarter
/// and that of each experiment, and if no shift of u lowers it further; otherwise the actuators are late. Loop gain
/// without a known controller cannot cause a false alarm: |1 - e^(j omega T d)| increases with frequency, whereas the
/// gain decreases.
///
/// Y U^-1 does not depend on r. Nothing is reported if the excitation has no names of actuators or too few lines.
std::optional<ExcitationDelay> align_excitation(HealthRecord& record,
                                                const std::optional<NominalStage>& nominal);

}  // namespace stageid
