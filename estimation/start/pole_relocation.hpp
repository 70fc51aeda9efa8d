#pragma once

#include <cstddef>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Modes by pole relocation (vector fitting, Gustavsen and Semlyen, IEEE Trans. Power Delivery 14 (1999)
/// 1052; relaxed: Gustavsen, 21 (2006) 1587): all modes at once, from a start that knows nothing.
///
/// In x = s, or x = z where hold and sampler are exact, with the delay taken out of the data H, every
/// channel c is fitted to
///   sigma(x) H_c(x) = N_c(x),   sigma = d + sum_i c_i phi_i(x),   N_c = sum_i r_ci phi_i(x) + ...
/// with the partial fractions phi_i of the current poles; sigma's coefficients are the channels' common
/// ones, its zeros are the next poles. The first poles stand where the response turns. Costs one elimination of n_c small normal matrices an iteration,
/// whatever the number of modes; the fixed point is near the minimum, not in it: a fit follows.
///
/// @param model what stands beside the modes, hold and delays; its modes are not looked at
/// @param weights n_c x N
/// @returns at most `modes` modes, sorted by frequency; two real poles are an overdamped one
std::vector<ModeCandidate> relocate_poles(const FrfEstimate& frf, const AdditiveModel& model,
                                          const Eigen::MatrixXd& weights, std::size_t modes,
                                          int threads);

}  // namespace stageid
