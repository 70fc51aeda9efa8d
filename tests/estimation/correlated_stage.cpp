#include "tests/estimation/correlated_stage.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid::test {

Eigen::MatrixXcd CorrelatedNoise::covariance(std::size_t k) const {
  const Eigen::Index n_y = C[k].rows();
  const Eigen::Index n_c = n_y * S[k].rows();
  Eigen::MatrixXcd out(n_c, n_c);
  for (Eigen::Index c = 0; c < n_c; ++c)
    for (Eigen::Index d = 0; d < n_c; ++d)
      out(c, d) = S[k](c / n_y, d / n_y) * C[k](c % n_y, d % n_y);
  return out;
}

Eigen::MatrixXcd correlated_matrix(RandomNumbers& random, Eigen::Index n, double correlation) {
  const std::complex<double> common = random.circular();
  const Eigen::VectorXcd together = (0.3 * circular_matrix(random, n, 1)).array() + common;
  const Eigen::VectorXd size = together.cwiseAbs();
  Eigen::MatrixXcd out =
      correlation * (together.cwiseQuotient(size) * together.cwiseQuotient(size).adjoint());
  out.diagonal().setOnes();
  Eigen::VectorXd scale(n);
  for (double& value : scale) value = std::exp(0.5 * random.normal());
  return scale.asDiagonal() * out * scale.asDiagonal();
}

CorrelatedNoise correlated_noise(const DenseProblem& problem, double level, double correlation,
                                 std::uint64_t seed) {
  RandomNumbers random(seed);
  const Eigen::Index n_y = problem.model.n_outputs();
  const Eigen::Index n_u = problem.model.n_inputs();
  const Eigen::MatrixXcd C_low = correlated_matrix(random, n_y, correlation);
  const Eigen::MatrixXcd C_high = correlated_matrix(random, n_y, correlation);
  const Eigen::MatrixXcd S_low = correlated_matrix(random, n_u, correlation);
  const Eigen::MatrixXcd S_high = correlated_matrix(random, n_u, correlation);
  const double size = level * problem.G.cwiseAbs().mean();
  CorrelatedNoise noise;
  const Eigen::Index N = problem.G.cols();
  for (Eigen::Index k = 0; k < N; ++k) {
    const double high = static_cast<double>(k) / static_cast<double>(N);
    noise.C.push_back(size * size * ((1.0 - high) * C_low + high * C_high));
    noise.S.push_back((1.0 - high) * S_low + high * S_high);
  }
  return noise;
}

FrfEstimate measured(const DenseProblem& problem, const CorrelatedNoise& noise,
                     RandomNumbers& random, int dof) {
  FrfEstimate frf = frf_of(problem);
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  frf.noise_dof = dof;
  frf.input_factor.resize(n_u * n_u, frf.lines());
  frf.residual_covariance.resize(n_y * n_y, frf.lines());
  frf.noise_variance.resize(n_y * n_u, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd L_C = cholesky(noise.C[k]);
    const Eigen::MatrixXcd L_S = cholesky(noise.S[k]);
    // vec(L_C N L_S^T) = (L_S kron L_C) vec N
    frf.response.col(k) += (L_C * circular_matrix(random, n_y, n_u) * L_S.transpose()).reshaped();
    Eigen::MatrixXcd C = noise.C[k];
    if (dof > 0) {
      const Eigen::MatrixXcd samples = L_C * circular_matrix(random, n_y, dof);
      C = samples * samples.adjoint() / static_cast<double>(dof);
    }
    frf.residual_covariance.col(k) = C.reshaped();
    frf.input_factor.col(k) = noise.S[k].reshaped();
    const Eigen::VectorXd y = C.diagonal().real();
    const Eigen::RowVectorXd u = noise.S[k].diagonal().real().transpose();
    frf.noise_variance.col(k) = (y * u).reshaped();
  }
  return frf;
}

/// Moves along one delay: all inputs (delay estimate), or input d, or output d - n_u.
static void shift_delay(AdditiveModel& model, DelayModel delay, Eigen::Index d, double by) {
  if (delay == DelayModel::estimate)
    model.input_delay_s.array() += by;
  else
    (d < model.n_inputs() ? model.input_delay_s[d] : model.output_delay_s[d - model.n_inputs()]) +=
        by;
}

std::vector<Eigen::MatrixXcd> joint_jacobian(const DenseProblem& problem, DelayModel delay) {
  const AdditiveModel& model = problem.model;
  const std::vector<Eigen::Index> first = first_of_theta(model);
  std::vector<Eigen::Index> order;  // columns of instrument_rows: denominators, then numerators
  std::vector<Eigen::Index> numerators;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const auto n = std::ssize(model.submodels[i].denominator) - 1;
    for (Eigen::Index p = first[i]; p < first[i + 1]; ++p)
      (p < first[i] + n ? order : numerators).push_back(p);
  }
  const auto denominators = std::ssize(order);
  order.insert(order.end(), numerators.begin(), numerators.end());
  const Eigen::Index delays = delay == DelayModel::fixed ? 0
                              : delay == DelayModel::estimate
                                  ? 1
                                  : model.n_outputs() + model.n_inputs() - 1;
  std::vector<Eigen::MatrixXcd> slopes;
  for (Eigen::Index d = 0; d < delays; ++d) {
    const double h = 1e-7;  // omega h is 1e-3 at the fastest line, its fourth power 1e-12
    const auto shifted = [&](double by) {
      AdditiveModel moved_model = model;
      shift_delay(moved_model, delay, d, by);
      return reference_response(moved_model, problem.frequency_hz, problem.hold);
    };
    slopes.push_back((8.0 * (shifted(h) - shifted(-h)) - (shifted(2.0 * h) - shifted(-2.0 * h))) /
                     (12.0 * h));
  }
  std::vector<Eigen::MatrixXcd> out;
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k) {
    const Eigen::MatrixXcd rows = instrument_rows(problem, k)(Eigen::all, order);
    Eigen::MatrixXcd J(rows.rows(), rows.cols() + delays);
    J << rows.leftCols(denominators), Eigen::MatrixXcd(rows.rows(), delays),
        rows.rightCols(rows.cols() - denominators);
    for (Eigen::Index d = 0; d < delays; ++d) J.col(denominators + d) = slopes[d].col(k);
    out.push_back(std::move(J));
  }
  return out;
}

DenseEquations dense_equations(const DenseProblem& at, const Eigen::MatrixXcd& G, DelayModel delay,
                               const std::function<Eigen::MatrixXcd(std::size_t)>& weights) {
  const std::vector<Eigen::MatrixXcd> J = joint_jacobian(at, delay);
  const Eigen::MatrixXcd E = G - reference_response(at.model, at.frequency_hz, at.hold);
  DenseEquations out{Eigen::MatrixXd::Zero(J[0].cols(), J[0].cols()),
                     Eigen::VectorXd::Zero(J[0].cols())};
  for (std::size_t k = 0; k < J.size(); ++k) {
    const Eigen::MatrixXcd JW = J[k].adjoint() * weights(k);
    out.M += (JW * J[k]).real();
    out.e += (JW * E.col(k)).real();
  }
  return out;
}

Eigen::MatrixXd scaled_inverse(const Eigen::MatrixXd& M) {
  const Eigen::VectorXd scale = M.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * M * scale.asDiagonal();
  const Eigen::MatrixXd inverted = inverse(scaled.cast<std::complex<double>>()).real();
  return scale.asDiagonal() * inverted * scale.asDiagonal();
}

void expect_mode_deviations(const Submodel& s, const Eigen::Matrix2d& C, double relative) {
  const double a1 = s.denominator[1];
  const double a2 = s.denominator[2];
  const double f_std = 0.5 * s.natural_frequency_hz() / a2 * std::sqrt(C(1, 1));
  const double zeta_std = s.damping_ratio() * std::sqrt(C(0, 0) / (a1 * a1) - C(0, 1) / (a1 * a2) +
                                                        C(1, 1) / (4.0 * a2 * a2));
  ASSERT_TRUE(s.natural_frequency_std_hz && s.damping_ratio_std);
  EXPECT_NEAR(*s.natural_frequency_std_hz, f_std, relative * f_std);
  EXPECT_NEAR(*s.damping_ratio_std, zeta_std, relative * zeta_std);
}

RankOneStage::RankOneStage() {
  RandomNumbers random(12);
  for (Submodel& s : problem.model.submodels) {
    if (!s.is_mode()) continue;
    const Eigen::VectorXd phi{{random.uniform(0.5, 1.5), random.uniform(0.5, 1.5)}};
    const Eigen::VectorXd psi{{random.normal(), random.normal(), random.normal()}};
    s.numerator[0] = s.denominator[2] * phi * psi.transpose();
  }
  measure(problem);
  noise = correlated_noise(problem, 0.01, 0.9);
}

}  // namespace stageid::test
