#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/equations/residue_form.hpp"

namespace stageid {

/// The free parameters of a model whose residues have given ranks: globals as in ArrowSystem, then the factors of
/// every submodel. With T = d(globals, B) / d(free parameters) their normal matrix is T^T M T, M that of the
/// unconstrained problem.
class ResidueFactors {
 public:
  /// Ranks as in FitOptions. Modes outside the lines represent everything that the plant has there, so their residues
  /// remain free. @throws std::invalid_argument for a rank that a submodel cannot have
  ResidueFactors(const FitProblem& problem, const FitParameters& beta, const FitOptions& options);

  Eigen::Index size() const noexcept { return size_; }
  const std::vector<int>& ranks() const noexcept { return ranks_; }  ///< 0: free

  /// Factors closest to the numerators of `beta`, weighted per entry (n_c x n_f).
  void project(const FitParameters& beta, const Eigen::MatrixXd& weight);
  /// Writes the numerators given by the factors.
  void write_numerators(FitParameters& beta) const;
  /// Moves the factors by their part of a step of the free parameters.
  void step(const Eigen::VectorXd& step);

  /// An entry of T: d B(c, function) / d parameter.
  struct Entry {
    Eigen::Index function;
    Eigen::Index parameter;
    double value;
  };
  std::vector<Entry> channel_entries(const FitParameters& beta, Eigen::Index channel) const;

  Eigen::MatrixXd reduced_matrix(const FitParameters& beta, const ArrowSystem& system) const;
  Eigen::VectorXd reduced_gradient(const FitParameters& beta, const ArrowSystem& system) const;

 private:
  struct Part {
    ResidueForm form;
    Eigen::Index functions;
    Eigen::Index first_function;
    Eigen::Index first_denominator;
    Eigen::Index first_parameter;
  };

  Eigen::Index n_outputs_;
  Eigen::Index n_inputs_;
  Eigen::Index globals_;
  Eigen::Index size_ = 0;
  std::vector<Part> parts_;
  std::vector<int> ranks_;
};

}  // namespace stageid
