#include "estimation/parameter_covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>

#include "estimation/weighted_products.hpp"

namespace stageid {
namespace {

/// Above this, a residual cannot be the noise alone.
constexpr double kClearlyTooLarge = 1.5;
// Of conjugate gradients; with their residual, variances have its square.
constexpr double kColumnTolerance = 1e-2;

/// K = sum Re{J^H W C W J} with the numerators' part of the globals' columns taken away: J_a - F Z.
struct Middle {
  Eigen::MatrixXd globals;
  std::vector<Eigen::MatrixXd> cross;  ///< globals x n_f, one a channel
  std::vector<Eigen::MatrixXd> own;    ///< n_f x n_f, one a channel
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

/// The channels' noise uncorrelated: `K` are the equations with the weights W C W.
Middle diagonal_middle(const ArrowSystem& gn, const ArrowSystem& K) {
  Middle out;
  out.globals = K.M_globals();
  for (std::size_t c = 0; c < gn.channels().size(); ++c) {
    const Eigen::MatrixXd& Z = gn.channels()[c].Z;
    const ArrowSystem::Channel& k = K.channels()[c];
    out.globals -= Z.transpose() * k.ba + k.ab * Z;
    out.globals += Z.transpose() * k.bb * Z;
    out.cross.emplace_back(k.ab - Z.transpose() * k.bb);
    out.own.push_back(k.bb);
  }
  return out;
}

/// Globals and cross terms again, the outputs of one input correlated.
void correlate_outputs(const FitProblem& problem, const FitParameters& beta,
                       const std::vector<BasisGroup>& groups, const ArrowSystem& gn,
                       const DataNoise& noise, Middle& middle) {
  const Eigen::Index n_y = problem.n_outputs;
  const auto columns = derivative_columns(problem);
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  std::vector<Eigen::MatrixXd> parts(static_cast<std::size_t>(problem.n_inputs));
  parallel_tasks(static_cast<int>(problem.n_inputs), problem.threads, [&](int u) {
    OutputColumns X;
    X.re.resize(static_cast<std::size_t>(n_y));
    X.im.resize(static_cast<std::size_t>(n_y));
    for (Eigen::Index y = 0; y < n_y; ++y) {
      const auto c = static_cast<std::size_t>(y + n_y * u);
      const auto at = static_cast<std::size_t>(y);
      projected_columns(problem, beta, *group_of[c], gn.channels()[c].Z, y + n_y * u, columns,
                        X.re[at], X.im[at]);
      const Eigen::ArrayXd scale = noise_scale(problem, noise, y + n_y * u);
      X.re[at].array().colwise() *= scale;
      X.im[at].array().colwise() *= scale;
    }
    const OutputColumns Y = correlated(noise.correlation, X);
    parts[static_cast<std::size_t>(u)] = correlated_gram(X, Y);
    for (Eigen::Index y = 0; y < n_y; ++y) {
      const auto c = static_cast<std::size_t>(y + n_y * u);
      const auto at = static_cast<std::size_t>(y);
      const Eigen::ArrayXd scale = noise_scale(problem, noise, y + n_y * u);
      const Eigen::MatrixXd F_re = group_of[c]->F_re.array().colwise() * scale;
      const Eigen::MatrixXd F_im = group_of[c]->F_im.array().colwise() * scale;
      middle.cross[c] = Y.re[at].transpose() * F_re + Y.im[at].transpose() * F_im;
    }
  });
  middle.globals.setZero();
  for (const Eigen::MatrixXd& part : parts) middle.globals += part;
}

/// What is known of one channel's numerators: Cov(nu_c) and Cov(a, nu_c), and Z.
struct ChannelCovariance {
  Eigen::MatrixXd own;
  Eigen::MatrixXd cross;
  Eigen::MatrixXd Z;
};

/// The variances of the channel's numerators and response; out.globals stands.
void fill_channel(const FitProblem& problem, const FitParameters& beta, const BasisGroup& group,
                  Eigen::Index c, const ChannelCovariance& channel, ParameterCovariance& out) {
  Eigen::VectorXd numerators = channel.own.diagonal();
  Eigen::VectorXd total = quadratic(group.F_re, group.F_im, channel.own, group.F_re, group.F_im);
  if (problem.globals() > 0) {
    const Eigen::MatrixXd& Z = channel.Z;
    numerators +=
        (Z * out.globals).cwiseProduct(Z).rowwise().sum() - 2.0 * (Z * channel.cross).diagonal();
    Eigen::MatrixXd J_re;
    Eigen::MatrixXd J_im;
    projected_columns(problem, beta, group, Z, c, derivative_columns(problem), J_re, J_im);
    total += quadratic(J_re, J_im, out.globals, J_re, J_im);
    total += 2.0 * quadratic(J_re, J_im, channel.cross, group.F_re, group.F_im);
  }
  out.numerator_variance.row(c) = numerators.transpose();
  out.response_variance.row(c) = total.transpose();
}

/// Calls task(group, channel) for all channels; the result is empty unless all return true.
void fill_channels(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                   ParameterCovariance& out,
                   const std::function<bool(const BasisGroup&, Eigen::Index)>& task) {
  out.numerator_variance.setZero(problem.channels(), problem.functions());
  out.response_variance.setZero(problem.channels(), problem.size());
  std::atomic<bool> determined = true;
  for (const BasisGroup& group : groups)
    parallel_tasks(static_cast<int>(group.channels.size()), problem.threads, [&](int r) {
      if (!task(group, group.channels[static_cast<std::size_t>(r)])) determined = false;
    });
  if (!determined) out = {};
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

std::vector<const BasisGroup*> groups_of_channels(const FitProblem& problem,
                                                  const std::vector<BasisGroup>& groups) {
  std::vector<const BasisGroup*> out(static_cast<std::size_t>(problem.channels()));
  for (const BasisGroup& group : groups)
    for (const Eigen::Index c : group.channels) out[static_cast<std::size_t>(c)] = &group;
  return out;
}

Eigen::ArrayXd noise_scale(const FitProblem& problem, const DataNoise& noise, Eigen::Index c) {
  const Eigen::ArrayXd W = problem.W.row(c).transpose().array();
  if (noise.variance.size() == 0) return W.sqrt();
  return W * noise.variance.row(c).transpose().array().sqrt();
}

FitProblem middle_problem(const FitProblem& problem, const DataNoise& noise) {
  FitProblem middle = problem;
  middle.W = problem.W.cwiseProduct(problem.W).cwiseProduct(noise.variance);
  return middle;
}

double covariance_scale(const FitProblem& problem, const Residual& E, Eigen::Index parameters,
                        const DataNoise& noise) {
  if (noise.knowledge == VarianceKnowledge::given) return 1.0;
  return residual_scale(residual_per_degree(problem, E, parameters),
                        noise.knowledge == VarianceKnowledge::weights);
}

ParameterCovariance parameter_covariance(const FitProblem& problem, const FitParameters& beta,
                                         const std::vector<BasisGroup>& groups, const Residual& E,
                                         const ArrowSystem& gn, const DataNoise& noise,
                                         const std::vector<Eigen::Index>& frozen) {
  ParameterCovariance out;
  if (!gn.regular()) return out;
  out.residual_scale = covariance_scale(problem, E, problem.parameters(), noise);
  const double half = 0.5 * out.residual_scale;

  Middle middle;
  if (noise.variance.size() > 0) {
    const FitProblem weighed = middle_problem(problem, noise);
    middle = diagonal_middle(gn, ArrowSystem(weighed, beta, groups, FitMethod::gn));
  } else {
    middle = diagonal_middle(gn, gn);
  }
  if (problem.globals() > 0 && noise.correlation.size() > 0)
    correlate_outputs(problem, beta, groups, gn, noise, middle);
  const Eigen::MatrixXd inverse = free_inverse(gn.schur(), frozen);
  if (problem.globals() > 0) out.globals = half * inverse * middle.globals * inverse.transpose();

  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(problem.functions(), problem.functions());
  fill_channels(problem, groups, out, [&](const BasisGroup& group, Eigen::Index c) {
    const auto at = static_cast<std::size_t>(c);
    Eigen::MatrixXd bb_inverse;
    if (!solve_scaled(gn.channels()[at].bb, unit, bb_inverse)) return false;
    fill_channel(problem, beta, group, c,
                 {half * bb_inverse * middle.own[at] * bb_inverse,
                  half * inverse * middle.cross[at] * bb_inverse, gn.channels()[at].Z},
                 out);
    return true;
  });
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

  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(problem.functions(), problem.functions());
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(globals, problem.functions());
  fill_channels(problem, groups, out, [&](const BasisGroup& group, Eigen::Index c) {
    const auto& arrow = equations.preconditioner().channels()[static_cast<std::size_t>(c)];
    Eigen::MatrixXd own;
    if (!solve_scaled(arrow.bb, unit, own)) return false;
    const Eigen::MatrixXd Z_c =
        Z(Eigen::seqN(c, problem.functions(), problem.channels()), Eigen::all);
    fill_channel(problem, beta, group, c, {half * own, none, Z_c}, out);
    return true;
  });
  return out;
}

}  // namespace stageid
