#pragma once

#include "estimation/equations/residue_factors.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"

namespace stageid {

/// Covariance of the free parameters of a fit with residues of given rank, see low_rank_covariance():
/// 1/2 N^-1 (T^T K T) N^-1 and 1/2 N^-1, times covariance_scale(). Empty if N is singular.
FitCovariance low_rank_parameters(const FitProblem& problem, const FitParameters& beta,
                                  const std::vector<BasisGroup>& groups, double cost,
                                  const ResidueFactors& factors, const DataNoise& noise,
                                  const std::vector<Eigen::Index>& frozen);

/// Covariance of a fit with residues of given rank, first order and sandwich form as in
/// parameter_covariance(): with the Jacobian J T of the free parameters (see ResidueFactors),
///   Cov = 1/2 N^-1 (T^T K T) N^-1,   N = T^T M T,   K = sum Re{J^H W C W J}.
/// The rank couples outputs and inputs of a mode; their noise is correlated between the outputs of one
/// input according to noise.correlation. Empty if N is singular.
ParameterCovariance low_rank_covariance(const FitProblem& problem, const FitParameters& beta,
                                        double cost, const ResidueFactors& factors,
                                        const DataNoise& noise,
                                        const std::vector<Eigen::Index>& frozen,
                                        bool with_response);

}  // namespace stageid
