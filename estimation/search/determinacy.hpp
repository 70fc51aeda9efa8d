#pragma once

#include <string>

#include "estimation/equations/arrow_system.hpp"

namespace stageid {

/// For messages: "submodel 2 (l=0, n=4, m=3, poles at 120.4, 181 Hz)", counted from 1.
std::string submodel_name(const FitProblem& problem, const FitParameters& beta, std::size_t i);

/// Whose numerators the data cannot tell apart: the submodels that the weakest direction of the
/// numerators' normal matrix (unit diagonal, weakest channel) stands on.
/// @returns empty if they are determined, which they are above 1e-12 of the largest direction
std::string undetermined_numerators(const FitProblem& problem, const FitParameters& beta,
                                    const std::vector<BasisGroup>& groups);

/// Whose poles the data do not determine, among submodels that were asked for or are no modes, and searched
/// modes with `judge_modes` (but those held where they are): a pole stands at a bound; a change of the denominator is imitated by the rest of the model to rounding;
/// a natural frequency's standard deviation is half of it, or a damping ratio's is all of it; or
/// its whole response is rounding (-160 dB of the data's weighted power) or within the noise.
/// @param cost of the fit   @param removal_cost what sum W |E|^2 would rise by without a submodel
/// @param gn the Gauss-Newton equations at `beta`   @param covariance of the globals, may be empty
/// @param frozen globals that were no unknowns   @param held submodels with a pole at a bound
/// @returns a reason that names the submodel, or nothing
std::string undetermined_poles(const FitProblem& problem, const FitParameters& beta, double cost,
                               const ArrowSystem& gn, const std::vector<double>& removal_cost,
                               const Eigen::MatrixXd& covariance,
                               const std::vector<Eigen::Index>& frozen,
                               const std::vector<std::size_t>& held, bool judge_modes);

}  // namespace stageid
