#pragma once

#include <vector>

#include "estimation/model/submodel_request.hpp"
#include "estimation/search/automatic_fit.hpp"

namespace stageid {

/// What stands in the model beside the modes of an automatic fit.
struct RequestedStructure {
  ModelStructure common;
  std::vector<SubmodelRequest> submodels;
  /// A free rigid body becomes one on weak springs where that is worth two parameters more (BIC).
  bool springs_if_worth = true;
  bool suspension =
      false;  ///< modes below the lowest line instead of 1/s^2: a rigid body on weak springs
  /// Their known frequencies, which stay; empty: one mode for all rigid degrees of freedom, whose
  /// frequency is fitted.
  std::vector<double> suspension_hz;
};

/// automatic_fit() with any submodels beside the modes.
///
/// Poles without a start are searched: modes in the number that the submodels need (automatic_fit with
/// that number), dealt out by frequency and multiplied together, odd ones on a grid of the profiled
/// cost. A suspension's frequency that the lines do not determine (standard deviation above half of
/// it, or at its bound) is held where the cost is least, and has no standard deviation. Far above a
/// suspension, w >> w_0, the lines see B/s^2 (1 - 2 zeta w_0/s - ...): first the product of
/// damping and frequency, then its square.
/// A submodel that the data do not determine gives FitStatus::undetermined, see determinacy.hpp.
/// @throws std::invalid_argument: as automatic_fit(), and for requests with a fault_of()
FitResult structured_fit(const FrfEstimate& frf, const RequestedStructure& structure,
                         const ModeSelection& selection, const FitOptions& options);

}  // namespace stageid
