#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// A block on the diagonal of A.
///
///   real pole      1 x 1   lambda
///   complex pair   2 x 2   [Re lambda, -Im lambda; Im lambda, Re lambda], Im lambda > 0
///   s^-2 chain     2 x 2   [0, 1; 0, 0]: position, velocity
struct StateBlock {
  Eigen::Index first = 0;
  Eigen::Index size = 1;
  std::complex<double> pole;  ///< of A: rad/s, or in the z plane if A is discrete
  long long submodel = 0;     ///< index into the model's; -1: a delay
};

/// x' = A x + B u, y = C x + D u, with ' the derivative or the next sample.
struct StateSpace {
  Eigen::MatrixXd A;  ///< n x n, block diagonal
  Eigen::MatrixXd B;  ///< n x n_u
  Eigen::MatrixXd C;  ///< n_y x n
  Eigen::MatrixXd D;  ///< n_y x n_u
  std::vector<StateBlock> blocks;

  Eigen::Index order() const noexcept { return A.rows(); }
};

/// The continuous-time model without its delays, in real modal form.
///
/// Each submodel is written in partial fractions, residues() of estimation/modal/submodel_residues.hpp, and
/// each residue R = Phi Psi^T by its singular vectors:
///   real pole       rank R states       B = Psi^T, C = Phi
///   complex pair    2 rank R            B = [Re Psi^T; Im Psi^T], C = [2 Re Phi, -2 Im Phi]
///   R_1/s + R_2/s^2 2 rank R_2 + rank (I - P_y) R_1 (I - P_u), P_y and P_u the orthogonal projectors
///                   on the columns and rows of R_2
/// which is the least number (Gilbert), unless two submodels share a pole and shapes. A rank is the
/// submodel's residue_rank if held, else the number of singular values above 1e-10 of the first: a free
/// residue of a 4 x 13 model has noise in all of them, so 8 states per mode.
/// Source: E. G. Gilbert, SIAM J. Control 1 (1963) 128; T. Kailath, Linear Systems (1980), ch. 6.
///
/// @throws std::invalid_argument if poles coincide within a submodel, a submodel is improper or has
/// more than two integrators, or its residue_rank contradicts its numerators.
StateSpace state_space(const AdditiveModel& model);

}  // namespace stageid
