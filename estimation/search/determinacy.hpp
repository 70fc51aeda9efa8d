#pragma once

#include <string>

#include "estimation/equations/arrow_system.hpp"

namespace stageid {

/// For messages: "submodel 2 (l=0, n=4, m=3, poles at 120.4, 181 Hz)", counted from 1.
std::string submodel_name(const FitProblem& problem, const FitParameters& beta, std::size_t i);

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
/// - the whole response is rounding (-160 dB of the weighted power of the data) or within the noise
/// @param cost of the fit   @param removal_cost rise of sum W |E|^2 without each submodel
/// @param gn the Gauss-Newton equations at `beta`   @param covariance of the globals, may be empty
/// @param frozen globals that were not unknowns   @param held submodels with a pole at a bound
/// @returns a reason that names the submodel; empty if all are determined
std::string undetermined_poles(const FitProblem& problem, const FitParameters& beta, double cost,
                               const ArrowSystem& gn, const std::vector<double>& removal_cost,
                               const Eigen::MatrixXd& covariance,
                               const std::vector<Eigen::Index>& frozen,
                               const std::vector<std::size_t>& held, bool judge_modes);

}  // namespace stageid
