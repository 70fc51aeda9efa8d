#pragma once

#include <string>

#include "estimation/equations/arrow_system.hpp"

namespace stageid {

/// Submodels whose numerators cannot be distinguished from the data: those with a share in the weakest direction of
/// the normal matrix of the numerators (unit diagonal, weakest channel).
/// @returns empty if they are determined: the weakest direction is above 1e-12 of the largest
std::string undetermined_numerators(const FitProblem& problem, const FitParameters& beta,
                                    const std::vector<BasisGroup>& groups);

/// Submodels with undetermined poles, among requested ones, those that are not modes, and with `judge_modes` searched
/// modes whose poles are not held. The poles of a submodel are undetermined in four cases:
/// - a pole is at a bound
/// - the rest of the model can imitate a change of the denominator to rounding
/// - the standard deviation of a natural frequency or a damping ratio is as large as the value
/// - what the others cannot replace of its response is rounding (-160 dB of the weighted power of the data) or noise
/// @param gn the Gauss-Newton equations at `beta`   @param covariance of the globals, may be empty
/// @param fit with its cost, removal costs, and held and frozen parameters
/// @returns a reason that names the submodel; empty if all are determined
std::string undetermined_poles(const FitProblem& problem, const FitParameters& beta,
                               const ArrowSystem& gn, const Eigen::MatrixXd& covariance,
                               bool judge_modes, const FitResult& fit);

}  // namespace stageid
