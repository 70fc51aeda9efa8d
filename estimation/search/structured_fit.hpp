#pragma once

#include <vector>

#include "estimation/model/submodel_request.hpp"
#include "estimation/search/automatic_fit.hpp"

namespace stageid {

/// The submodels besides the modes of an automatic fit.
struct RequestedStructure {
  /// With an open rigid body, a free one is replaced by one on springs if that is worth its parameters.
  ModelStructure common{.open = {.rigid_body = true}};
  std::vector<SubmodelRequest> submodels;
  bool suspension =
      false;  ///< modes below the lowest line instead of 1/s^2: a rigid body on weak springs
  /// Their known frequencies, which are held; empty: one mode for all rigid degrees of freedom, with a fitted
  /// frequency.
  std::vector<double> suspension_hz;
};

/// automatic_fit() with any submodels besides the modes.
///
/// Poles without a start are searched: automatic_fit() finds as many modes as the submodels need. These are
/// distributed by frequency and their denominators multiplied; real poles are searched on a grid of the profiled cost.
/// A suspension frequency that the lines do not determine (standard deviation above half of it, or at its bound) is
/// held where the cost is smallest, without a standard deviation. Far above a suspension, w >> w_0, the lines depend
/// on B/s^2 (1 - 2 zeta w_0/s - ...): first on the product of damping and frequency, then on its square.
/// Undetermined submodels give FitStatus::undetermined, see determinacy.hpp.
/// @throws std::invalid_argument: as automatic_fit(), and for requests with a fault_of()
FitResult structured_fit(const FrfEstimate& frf, const RequestedStructure& structure,
                         const ModeSelection& selection, const FitOptions& options);

}  // namespace stageid
