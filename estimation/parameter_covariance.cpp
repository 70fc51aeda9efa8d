#include "estimation/parameter_covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimation/weighted_products.hpp"

namespace stageid {
namespace {

/// Above this, a residual cannot be the noise alone.
constexpr double kClearlyTooLarge = 1.5;
// Of conjugate gradients; with their residual, variances have its square.
constexpr double kColumnTolerance = 1e-2;

/// K as an arrow: its globals with channels not eliminated, and the channel blocks.
struct Middle {
  const ArrowSystem& system;
  double scale;
};

/// The part of those columns that the channel's numerators cannot follow: J_a - F Z, with Z the
/// channel's rows of M_bb^-1 M_ba.
void projected_columns(const FitProblem& problem, const FitParameters& beta,
                       const BasisGroup& group, const Eigen::MatrixXd& Z, Eigen::Index c,
                       const std::vector<DerivativeColumn>& columns, Eigen::MatrixXd& re,
                       Eigen::MatrixXd& im) {
  global_columns(problem, beta, group, c, columns, re, im);
  re -= group.F_re * Z;
  im -= group.F_im * Z;
}

/// Lower triangular L(k) with L L^H the correlation, (n_y n_y) x N.
Eigen::MatrixXcd correlation_factors(const Eigen::MatrixXcd& correlation, Eigen::Index n_y) {
  Eigen::MatrixXcd factors(correlation.rows(), correlation.cols());
  for (Eigen::Index k = 0; k < correlation.cols(); ++k) {
    Eigen::MatrixXcd matrix = correlation.col(k).reshaped(n_y, n_y);
    matrix.diagonal().array() += 1e-9;  // fewer degrees of freedom than outputs: singular
    factors.col(k) = Eigen::MatrixXcd(matrix.llt().matrixL()).reshaped();
  }
  return factors;
}

/// K on the globals, sum_k Re{J^H W C W J} with the outputs of one input correlated.
Eigen::MatrixXd correlated_middle(const FitProblem& problem, const FitParameters& beta,
                                  const std::vector<BasisGroup>& groups, const ArrowSystem& gn,
                                  const DataNoise& noise) {
  const Eigen::Index n_y = problem.n_outputs;
  const auto columns = derivative_columns(problem);
  const Eigen::MatrixXcd L = correlation_factors(noise.correlation, n_y);
  std::vector<const BasisGroup*> group_of(static_cast<std::size_t>(problem.channels()));
  for (const BasisGroup& group : groups)
    for (const Eigen::Index c : group.channels) group_of[static_cast<std::size_t>(c)] = &group;
  std::vector<Eigen::MatrixXd> parts(static_cast<std::size_t>(problem.n_inputs));
  parallel_tasks(static_cast<int>(problem.n_inputs), problem.threads, [&](int u) {
    std::vector<Eigen::MatrixXd> J_re(static_cast<std::size_t>(n_y));
    std::vector<Eigen::MatrixXd> J_im(static_cast<std::size_t>(n_y));
    for (Eigen::Index y = 0; y < n_y; ++y) {
      const Eigen::Index c = y + n_y * u;
      const auto at = static_cast<std::size_t>(y);
      projected_columns(problem, beta, *group_of[static_cast<std::size_t>(c)],
                        gn.channels()[static_cast<std::size_t>(c)].Z, c, columns, J_re[at],
                        J_im[at]);
      const Eigen::ArrayXd scale =
          (problem.W.row(c).array() * noise.variance.row(c).array().sqrt()).transpose();
      J_re[at].array().colwise() *= scale;
      J_im[at].array().colwise() *= scale;
    }
    Eigen::MatrixXd& K = parts[static_cast<std::size_t>(u)];
    K.setZero(problem.globals(), problem.globals());
    for (Eigen::Index r = 0; r < n_y; ++r) {
      Eigen::MatrixXd Y_re = Eigen::MatrixXd::Zero(problem.size(), problem.globals());
      Eigen::MatrixXd Y_im = Y_re;
      for (Eigen::Index y = r; y < n_y; ++y) {  // conj(J) L
        const auto at = static_cast<std::size_t>(y);
        const Eigen::ArrayXd re = L.row(y + n_y * r).real().transpose().array();
        const Eigen::ArrayXd im = L.row(y + n_y * r).imag().transpose().array();
        Y_re.array() += J_re[at].array().colwise() * re + J_im[at].array().colwise() * im;
        Y_im.array() += J_re[at].array().colwise() * im - J_im[at].array().colwise() * re;
      }
      K.noalias() += Y_re.transpose() * Y_re;
      K.noalias() += Y_im.transpose() * Y_im;
    }
  });
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(problem.globals(), problem.globals());
  for (const Eigen::MatrixXd& part : parts) K += part;
  return K;
}

/// K on the globals, the channels' noise uncorrelated.
Eigen::MatrixXd diagonal_middle(const ArrowSystem& gn, const Middle& K) {
  Eigen::MatrixXd middle = K.system.M_globals();
  for (std::size_t c = 0; c < gn.channels().size(); ++c) {
    const Eigen::MatrixXd& Z = gn.channels()[c].Z;
    const ArrowSystem::Channel& k = K.system.channels()[c];
    middle -= Z.transpose() * k.ba + k.ab * Z;
    middle += Z.transpose() * k.bb * Z;
  }
  return middle;
}

}  // namespace

double residual_per_degree(const FitProblem& problem, const Residual& E, Eigen::Index parameters) {
  const double data = static_cast<double>(problem.size() * problem.channels());
  return 2.0 * static_cast<double>(problem.size()) * E.cost /
         std::max(data - 0.5 * static_cast<double>(parameters), 1.0);
}

double residual_scale(double per_degree, bool likelihood) {
  return likelihood && per_degree < kClearlyTooLarge ? 1.0 : per_degree;
}

Eigen::MatrixXd free_inverse(const Eigen::MatrixXd& S, const std::vector<Eigen::Index>& frozen) {
  if (S.size() == 0) return S;
  Eigen::MatrixXd reduced = S;
  hold_unknowns(frozen, reduced);
  const Eigen::VectorXd scale =
      reduced.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd inverse =
      scale.asDiagonal() *
      (scale.asDiagonal() * reduced * scale.asDiagonal()).fullPivLu().inverse() *
      scale.asDiagonal();
  for (const Eigen::Index i : frozen) {
    inverse.row(i).setZero();
    inverse.col(i).setZero();
  }
  return inverse;
}

Eigen::VectorXd quadratic(const Eigen::MatrixXd& X_re, const Eigen::MatrixXd& X_im,
                          const Eigen::MatrixXd& C, const Eigen::MatrixXd& Y_re,
                          const Eigen::MatrixXd& Y_im) {
  return (X_re * C).cwiseProduct(Y_re).rowwise().sum() +
         (X_im * C).cwiseProduct(Y_im).rowwise().sum();
}

Eigen::MatrixXcd output_correlation(const FrfEstimate& frf) {
  if (frf.residual_covariance_re.size() == 0) return {};
  const Eigen::Index n_y = frf.n_outputs();
  Eigen::MatrixXcd out(n_y * n_y, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    for (Eigen::Index i = 0; i < n_y; ++i)
      for (Eigen::Index l = 0; l < n_y; ++l) {
        const double power = frf.residual_covariance_re(i * (n_y + 1), k) *
                             frf.residual_covariance_re(l * (n_y + 1), k);
        const Eigen::Index at = i + n_y * l;
        if (i == l)
          out(at, k) = 1.0;
        else
          out(at, k) = power > 0.0 ? std::complex<double>(frf.residual_covariance_re(at, k),
                                                          frf.residual_covariance_im(at, k)) /
                                         std::sqrt(power)
                                   : 0.0;
      }
  return out;
}

ParameterCovariance parameter_covariance(const FitProblem& problem, const FitParameters& beta,
                                         const std::vector<BasisGroup>& groups, const Residual& E,
                                         const ArrowSystem& gn, const DataNoise& noise,
                                         const std::vector<Eigen::Index>& frozen) {
  ParameterCovariance out;
  if (!gn.regular()) return out;
  if (noise.knowledge != VarianceKnowledge::given)
    out.residual_scale = residual_scale(residual_per_degree(problem, E, problem.parameters()),
                                        noise.knowledge == VarianceKnowledge::weights);

  FitProblem sandwich;
  std::vector<ArrowSystem> other;
  if (noise.knowledge == VarianceKnowledge::given) {
    sandwich = problem;
    sandwich.W = problem.W.cwiseProduct(problem.W).cwiseProduct(noise.variance);
    other.emplace_back(sandwich, beta, groups, FitMethod::gn);
  }
  const Middle K{other.empty() ? gn : other.front(), out.residual_scale};
  const Eigen::MatrixXd inverse = free_inverse(gn.schur(), frozen);
  if (problem.globals() > 0) {
    const bool correlated = noise.correlation.size() > 0 && noise.variance.size() > 0;
    const Eigen::MatrixXd middle =
        correlated ? correlated_middle(problem, beta, groups, gn, noise) : diagonal_middle(gn, K);
    out.globals = 0.5 * K.scale * inverse * middle * inverse.transpose();
  }

  out.response_variance.resize(problem.channels(), problem.size());
  const auto columns = derivative_columns(problem);
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(problem.functions(), problem.functions());
  for (const BasisGroup& group : groups) {
    parallel_tasks(static_cast<int>(group.channels.size()), problem.threads, [&](int r) {
      const Eigen::Index c = group.channels[static_cast<std::size_t>(r)];
      const ArrowSystem::Channel& m = gn.channels()[static_cast<std::size_t>(c)];
      const ArrowSystem::Channel& k = K.system.channels()[static_cast<std::size_t>(c)];
      Eigen::MatrixXd bb_inverse;
      if (!solve_scaled(m.bb, unit, bb_inverse)) return;
      Eigen::MatrixXd J_re;
      Eigen::MatrixXd J_im;
      projected_columns(problem, beta, group, m.Z, c, columns, J_re, J_im);
      const Eigen::MatrixXd own = 0.5 * K.scale * bb_inverse * k.bb * bb_inverse;
      const Eigen::MatrixXd cross =
          0.5 * K.scale * inverse * (k.ab - m.Z.transpose() * k.bb) * bb_inverse;
      Eigen::VectorXd total = quadratic(group.F_re, group.F_im, own, group.F_re, group.F_im);
      if (problem.globals() > 0) {
        total += quadratic(J_re, J_im, out.globals, J_re, J_im);
        total += 2.0 * quadratic(J_re, J_im, cross, group.F_re, group.F_im);
      }
      out.response_variance.row(c) = total.transpose();
    });
  }
  return out;
}

ParameterCovariance joint_covariance(const FitProblem& problem, const FitParameters& beta,
                                     const std::vector<BasisGroup>& groups, const Residual& E,
                                     const JointEquations& equations, VarianceKnowledge knowledge,
                                     double scatter_factor,
                                     const std::vector<Eigen::Index>& frozen) {
  ParameterCovariance out;
  if (!equations.regular()) return out;
  out.residual_scale = residual_scale(residual_per_degree(problem, E, problem.parameters()),
                                      knowledge == VarianceKnowledge::weights);
  const double half = 0.5 * scatter_factor * out.residual_scale;

  // Columns of M^-1 for the globals: X_a of the globals themselves, X_b of the numerators. With X = M^-1
  // - dX and residuals R = M dX,  X_a + X^T R = (M^-1)_aa - dX^T M dX.
  const Eigen::Index globals = problem.globals();
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(equations.size(), globals);
  Eigen::MatrixXd R = X;
  for (Eigen::Index i = 0; i < globals; ++i) {
    if (std::find(frozen.begin(), frozen.end(), i) != frozen.end()) continue;
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(equations.size(), i);
    const JointEquations::Solution column = equations.solve(unit, frozen, kColumnTolerance);
    X.col(i) = column.x;
    R.col(i) = column.residual;
  }
  Eigen::MatrixXd X_a = X.topRows(globals) + X.transpose() * R;
  X_a = (0.5 * (X_a + X_a.transpose())).eval();
  out.globals = half * X_a;
  const Eigen::MatrixXd Z = -X.bottomRows(X.rows() - globals) * free_inverse(X_a, frozen);

  out.response_variance.resize(problem.channels(), problem.size());
  const auto columns = derivative_columns(problem);
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(problem.functions(), problem.functions());
  for (const BasisGroup& group : groups) {
    parallel_tasks(static_cast<int>(group.channels.size()), problem.threads, [&](int r) {
      const Eigen::Index c = group.channels[static_cast<std::size_t>(r)];
      const auto& arrow = equations.preconditioner().channels()[static_cast<std::size_t>(c)];
      Eigen::MatrixXd own;
      if (!solve_scaled(arrow.bb, unit, own)) return;
      const Eigen::MatrixXd Z_c =
          Z(Eigen::seqN(c, problem.functions(), problem.channels()), Eigen::all);
      Eigen::MatrixXd J_re;
      Eigen::MatrixXd J_im;
      projected_columns(problem, beta, group, Z_c, c, columns, J_re, J_im);
      const Eigen::VectorXd total =
          half * quadratic(group.F_re, group.F_im, own, group.F_re, group.F_im) +
          quadratic(J_re, J_im, out.globals, J_re, J_im);
      out.response_variance.row(c) = total.transpose();
    });
  }
  return out;
}

}  // namespace stageid
