#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// A pole other than the origin and its residue. A complex pair is stored once, with the pole of positive imaginary
/// part: R/(s - lambda) + conj(R)/(s - conj(lambda)).
struct PoleResidue {
  std::complex<double> pole_rad_s;
  Eigen::MatrixXcd residue;  ///< n_y x n_u; real for a real pole
  bool is_real() const noexcept { return pole_rad_s.imag() == 0.0; }
};

/// A submodel in partial fractions,
///   P_i(s) = D + R_1/s + R_2/s^2 + sum_r R_r/(s - lambda_r),
/// with R_r = B(lambda_r) / (lambda_r^l a_n prod_{o != r} (lambda_r - lambda_o)),
/// R_l = B_0, for l = 2 also R_1 = B_1 - a_1 B_0, and D = B_{n+l}/a_n.
struct SubmodelResidues {
  Eigen::MatrixXd direct;             ///< D, n_y x n_u; zero if strictly proper
  Eigen::MatrixXd integrator;         ///< R_1
  Eigen::MatrixXd double_integrator;  ///< R_2
  std::vector<PoleResidue> poles;
};

/// The poles of A, each complex pair once, with positive imaginary part.
std::vector<std::complex<double>> pole_representatives(const Submodel& submodel);

/// B(s) = B_0 + B_1 s + ...
Eigen::MatrixXcd numerator_at(const Submodel& submodel, std::complex<double> s);

/// @param index of the submodel, for errors
/// @throws std::invalid_argument if two poles of A are within 1e-6 of each other (relative), if there
/// are more than two integrators, or if the submodel is improper.
SubmodelResidues residues(const Submodel& submodel, std::size_t index);

/// Rank of a residue: submodel.residue_rank if a fit held it at that rank, else the number of singular values above
/// kRankTolerance of the first.
/// @throws std::invalid_argument if residue_rank contradicts the values: the next one is above 1e-6 of the first.
Eigen::Index residue_rank(const Submodel& submodel, std::size_t index,
                          const Eigen::VectorXd& singular_values);

}  // namespace stageid
