#pragma once

#include <vector>

#include "estimation/model/submodel_request.hpp"
#include "estimation/search/automatic_fit.hpp"

namespace stageid {

/// The submodels besides the modes of an automatic fit.
struct RequestedStructure {
  ModelStructure common{.open = {.rigid_body = true}};
  std::vector<SubmodelRequest> submodels;
  bool suspension =
      false;  ///< modes below the lowest line instead of 1/s^2: a rigid body on weak springs
  /// Their known frequencies, which are held; empty: one mode for all rigid degrees of freedom, with a fitted
  /// frequency.
  std::vector<double> suspension_hz;
};

/// @throws std::invalid_argument: submodels with a fault_of(), a suspension besides a rigid body or not below the lines
void check(const FrfEstimate& frf, const RequestedStructure& structure);

/// automatic_fit() with any submodels besides the modes.
///
/// Poles without a start are searched: automatic_fit() finds as many modes as the submodels need. These are
/// distributed by frequency and their denominators multiplied; real poles are searched on a grid of the profiled cost.
/// Suspension frequencies that the lines do not determine are held, see settled_fit().
/// Undetermined submodels give FitStatus::undetermined, see determinacy.hpp.
/// @throws std::invalid_argument: as automatic_fit() and check()
FitResult structured_fit(const FrfEstimate& frf, const RequestedStructure& structure,
                         const ModeSelection& selection, const FitOptions& options);

}  // namespace stageid
