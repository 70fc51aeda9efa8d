#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Parametrization of the numerators B_0 .. B_m of a submodel by free parameters rho.
///
///   full         the entries themselves
///   real         B_0 = Phi Psi^T, Phi n_y x r, Psi n_u x r: a mechanical mode (r = 1) with
///                proportional damping, a rigid body with r degrees of freedom
///   complex      L = phi psi^T complex, residue of the pole lambda, for modes with B_0 and B_1:
///                B_1 = 2 a_2 Re L, B_0 = -2 a_2 Re(conj(lambda) L): general viscous damping
///
/// Psi is determined only up to a factor (a regular r x r matrix), so its r best conditioned rows are held at the
/// identity. See docs/theory.md, section 5.
class ResidueForm {
 public:
  /// @param rank 0: full. `shape` must have one numerator coefficient, or be a mode with two and rank 1. @throws
  /// std::invalid_argument
  ResidueForm(const SubmodelShape& shape, int rank, Eigen::Index n_outputs, Eigen::Index n_inputs);

  /// The best approximation of numerators B (n_c x m+1) in this form, weighted per entry (n_y x n_u, inverse
  /// variances).
  void project(const Eigen::VectorXd& a, const Eigen::MatrixXd& B, const Eigen::MatrixXd& weight);

  /// B, n_c x (m+1), of the current parameters.
  Eigen::MatrixXd numerators(const Eigen::VectorXd& a) const;

  /// One entry of dB_m(channel) / d parameter: `parameter` counts rho from 0; -1 is a_1, -2 is a_2.
  struct Derivative {
    Eigen::Index function;
    Eigen::Index parameter;
    double value;
  };
  void derivatives(const Eigen::VectorXd& a, Eigen::Index channel,
                   std::vector<Derivative>& out) const;

  Eigen::Index size() const noexcept { return rho_size_; }
  void step(const Eigen::Ref<const Eigen::VectorXd>& step);

 private:
  enum class Kind : std::uint8_t { full, real, complex };
  Eigen::Index psi_parameter(Eigen::Index input, Eigen::Index column) const;

  Kind kind_ = Kind::full;
  Eigen::Index n_y_;
  Eigen::Index n_u_;
  Eigen::Index functions_;
  Eigen::Index rank_;
  Eigen::Index rho_size_ = 0;
  Eigen::MatrixXd full_;                  // n_c x functions
  Eigen::MatrixXcd phi_;                  // n_y x rank, real part only for Kind::real
  Eigen::MatrixXcd psi_;                  // n_u x rank
  std::vector<Eigen::Index> free_input_;  // index of an input among the free rows of Psi; -1: held
};

}  // namespace stageid
