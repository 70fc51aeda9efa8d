#pragma once

#include <functional>

#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test {

/// Noise of a measured FRF, Cov(vec G) = S kron C_E on every line, both changing from line to line.
struct CorrelatedNoise {
  std::vector<Eigen::MatrixXcd> C;  ///< n_y x n_y per line
  std::vector<Eigen::MatrixXcd> S;  ///< n_u x n_u per line

  /// Written out, n_c x n_c.
  Eigen::MatrixXcd covariance(std::size_t k) const;
};

/// L L^H with unit-like diagonal and correlations of magnitude up to `correlation`.
Eigen::MatrixXcd correlated_matrix(RandomNumbers& random, Eigen::Index n, double correlation);

/// One disturbance that moves all outputs, inputs that are far from orthogonal, both drifting over
/// the lines; deviations of about `level` times the mean response.
CorrelatedNoise correlated_noise(const DenseProblem& problem, double level, double correlation,
                                 std::uint64_t seed = 4);

/// The exact response with such noise and its covariance: exact if dof is 0, else C_E from that many degrees of
/// freedom.
FrfEstimate measured(const DenseProblem& problem, const CorrelatedNoise& noise,
                     RandomNumbers& random, int dof = 0);

/// dP / d(all parameters) in the library's order, a matrix n_c x n a line: denominators, delays (by
/// differences of the reference response), numerators function by function.
std::vector<Eigen::MatrixXcd> joint_jacobian(const DenseProblem& problem, DelayModel delay);

/// M = sum Re{J^H W J}, e = sum Re{J^H W vec E} of all parameters with W written out.
struct DenseEquations {
  Eigen::MatrixXd M;
  Eigen::VectorXd e;
};
DenseEquations dense_equations(const DenseProblem& at, const Eigen::MatrixXcd& G, DelayModel delay,
                               const std::function<Eigen::MatrixXcd(std::size_t)>& weights);

Eigen::MatrixXd scaled_inverse(const Eigen::MatrixXd& M);

/// The reported deviations of a mode against those of f = 1 / (2 pi sqrt a_2) and zeta = a_1 / (2 sqrt a_2).
/// @param C covariance of a_1, a_2
void expect_mode_deviations(const Submodel& s, const Eigen::Matrix2d& C, double relative);

/// The 2 x 3 stage with modes of rank one, one disturbance on both outputs, and inputs that repeat what the controller
/// makes of it.
struct RankOneStage {
  DenseProblem problem = noisy_stage(HoldModel::exact, 0.0);
  CorrelatedNoise noise;

  RankOneStage();
  FrfEstimate measured_with(std::uint64_t seed) const {
    RandomNumbers random(seed);
    return measured(problem, noise, random);
  }
};

/// One measurement of the 2 x 3 stage with strongly correlated noise.
struct Measurement {
  DenseProblem problem = noisy_stage(HoldModel::exact, 0.0);
  CorrelatedNoise noise = correlated_noise(problem, 0.02, 0.95);
  FrfEstimate frf;
  explicit Measurement(std::uint64_t seed = 5, int dof = 0) {
    RandomNumbers random(seed);
    frf = measured(problem, noise, random, dof);
  }
  AdditiveModel start() const { return moved(problem.model, 1.003, 1.2); }
};

}  // namespace stageid::test
