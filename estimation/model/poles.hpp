#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// a_1 .. a_n of  prod (1 - s / lambda),  the inverse of roots().
/// @param poles complex ones with their conjugates, in any order
/// @pre no pole is zero
Eigen::VectorXd denominator_of(const std::vector<std::complex<double>>& poles);

/// The poles of a mode with damping ratio in (0, 1).
std::vector<std::complex<double>> mode_poles(double frequency_hz, double damping_ratio);

/// Natural frequencies and damping ratios of the poles of a (size n), rising; a conjugate pair counts once.
///
/// With the covariance of a they have standard deviations, by the delta method with
/// dlambda/da_q = -lambda^q / A'(lambda), |lambda|, and -Re lambda / |lambda|.
/// @param covariance n x n; empty: unknown, or a pole is at a bound
std::vector<PoleEstimate> pole_estimates(const Eigen::Ref<const Eigen::VectorXd>& a,
                                         const Eigen::Ref<const Eigen::MatrixXd>& covariance);

}  // namespace stageid
