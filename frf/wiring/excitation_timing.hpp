#pragma once

#include <optional>

#include "frf/periods/health_finding.hpp"
#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// The excitation as recorded, against the actuators.
struct ExcitationDelay {
  int samples = 0;      ///< > 0: recorded later than it acted
  double misfit = 0.0;  ///< of u - r + C y, without it over with it
  bool certain = true;  ///< else all actuators may have been recorded early instead
};
Finding to_finding(const ExcitationDelay& delay);

/// Was the excitation recorded whole samples late, or early? If so, it is put right in `record`.
///
/// With the controller u + C y is r, and its cross-correlation with the recorded r has its peak where the record is late.
/// Without, u is near r in the upper half of the band, where the loop does little. The shift counts if it lowers the
/// misfit |u + C y - r|^2, every line and axis over |r|^2, to a quarter in the whole and lowers that of each experiment; and if no shift
/// of u lowers it further: then it is the actuators that are late. What a loop gain leaves without the controller cannot
/// look like it: |1 - e^(j omega T d)| grows with frequency where the gain falls.
///
/// Y U^-1 does not depend on r. Without scatter, names of actuators on the excitation, or lines, nothing is reported.
std::optional<ExcitationDelay> align_excitation(HealthRecord& record,
                                                const std::optional<NominalStage>& nominal);

}  // namespace stageid
