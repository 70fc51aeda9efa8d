#pragma once

#include <cstddef>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "excitation/threads/team.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Modes by pole relocation (vector fitting, Gustavsen and Semlyen, IEEE Trans. Power Delivery 14 (1999)
/// 1052; relaxed: Gustavsen, 21 (2006) 1587): all modes at once, without prior knowledge.
///
/// In x = s, or x = z if hold and sampler are exact, with the delay removed from the data H, every
/// channel c is fitted to
///   sigma(x) H_c(x) = N_c(x),   sigma = d + sum_i c_i phi_i(x),   N_c = sum_i r_ci phi_i(x) + ...
/// with the partial fractions phi_i of the current poles. The coefficients of sigma are common to the channels,
/// and its zeros are the next poles. The first poles are where the response changes phase or magnitude most.
/// Each iteration eliminates n_c small normal matrices, for any number of modes. The fixed point is near the minimum,
/// but not at it, so a fit must follow.
///
/// @param model the submodels besides the modes, hold and delays; its modes are ignored
/// @param weights n_c x N
/// @returns at most `modes` modes, sorted by frequency; two real poles form an overdamped one
std::vector<ModeCandidate> relocate_poles(const FrfEstimate& frf, const AdditiveModel& model,
                                          const Eigen::MatrixXd& weights, std::size_t modes,
                                          const Workers& workers);

}  // namespace stageid
