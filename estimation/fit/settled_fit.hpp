#pragma once

#include "estimation/fit/fit_verdict.hpp"

namespace stageid {

/// The last fit of a search. If the modes were chosen and the iteration does not converge, it is made simpler one step
/// at a time until it does. First, one of two modes that converged to each other is left out, see coincident_pair();
/// then the least determined mode, see pole_doubt(). If the data need it (BIC), only its pole is held. If none of
/// these fits converges, or only at one and a half times the cost, the first one is returned unchanged. From a fit that
/// converges, undetermined modes between the lines are removed if they are not worth their parameters (BIC).
///
/// For any number of modes, the frequencies of suspensions that the lines do not determine are held, without a standard
/// deviation. Far above a suspension, w >> w_0, the lines depend on B/s^2 (1 - 2 zeta w_0/s - ...): first on the
/// product of damping and frequency, then on its square.
/// @returns the fit, with a line in FitResult::decisions per change
/// @throws std::invalid_argument: as fit_additive_model()
FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options,
                      ModeNumber number = ModeNumber::chosen);

}  // namespace stageid
