#include "estimation/parameter_covariance.hpp"

#include <Eigen/LU>

#include "estimation/weighted_products.hpp"

namespace stageid {
namespace {

/// Above this, a residual cannot be the noise alone.
constexpr double kClearlyTooLarge = 1.5;

double residual_per_degree(const FitProblem& problem, const Residual& E) {
  const double data = static_cast<double>(problem.size() * problem.channels());
  const double parameters =
      static_cast<double>(problem.globals() + problem.channels() * problem.functions());
  return 2.0 * static_cast<double>(problem.size()) * E.cost /
         std::max(data - 0.5 * parameters, 1.0);
}

/// K as an arrow: its globals with channels not eliminated, and the channel blocks.
struct Middle {
  const ArrowSystem& system;
  double scale;
};

Eigen::MatrixXd covariance_of_globals(const ArrowSystem& gn, const Middle& K,
                                      const Eigen::MatrixXd& inverse) {
  Eigen::MatrixXd middle = K.system.M_globals();
  for (std::size_t c = 0; c < gn.channels().size(); ++c) {
    const Eigen::MatrixXd& Z = gn.channels()[c].Z;
    const ArrowSystem::Channel& k = K.system.channels()[c];
    middle -= Z.transpose() * k.ba + k.ab * Z;
    middle += Z.transpose() * k.bb * Z;
  }
  return 0.5 * K.scale * inverse * middle * inverse.transpose();
}

/// Columns d vec(P)_c / d globals on every line for one channel, real and imaginary.
void global_columns(const FitProblem& problem, const FitParameters& beta, const BasisGroup& group,
                    Eigen::Index c, const std::vector<DerivativeColumn>& columns,
                    Eigen::MatrixXd& re, Eigen::MatrixXd& im) {
  re.setZero(problem.size(), problem.globals());
  im.setZero(problem.size(), problem.globals());
  for (std::size_t d = 0; d < columns.size(); ++d) {
    const auto column = static_cast<Eigen::Index>(d);
    re.col(columns[d].parameter) += beta.B(c, columns[d].function) * group.D_re.col(column);
    im.col(columns[d].parameter) += beta.B(c, columns[d].function) * group.D_im.col(column);
  }
  if (problem.delay == DelayModel::fixed) return;
  const Eigen::VectorXd t_re = group.T_re * beta.B.row(c).transpose();
  const Eigen::VectorXd t_im = group.T_im * beta.B.row(c).transpose();
  const Eigen::Index first = problem.denominators();
  if (problem.delay == DelayModel::estimate) {
    re.col(first) = t_re;
    im.col(first) = t_im;
    return;
  }
  const Eigen::Index y = c % problem.n_outputs;
  const Eigen::Index u = c / problem.n_outputs;
  re.col(first + u) = t_re;
  im.col(first + u) = t_im;
  if (y + 1 < problem.n_outputs) {
    re.col(first + problem.n_inputs + y) = t_re;
    im.col(first + problem.n_inputs + y) = t_im;
  }
}

/// Diagonal of X C Y^T summed over real and imaginary parts.
Eigen::VectorXd quadratic(const Eigen::MatrixXd& X_re, const Eigen::MatrixXd& X_im,
                          const Eigen::MatrixXd& C, const Eigen::MatrixXd& Y_re,
                          const Eigen::MatrixXd& Y_im) {
  return (X_re * C).cwiseProduct(Y_re).rowwise().sum() +
         (X_im * C).cwiseProduct(Y_im).rowwise().sum();
}

}  // namespace

ParameterCovariance parameter_covariance(const FitProblem& problem, const FitParameters& beta,
                                         const std::vector<BasisGroup>& groups, const Residual& E,
                                         const ArrowSystem& gn, VarianceKnowledge knowledge,
                                         const Eigen::MatrixXd& variance) {
  ParameterCovariance out;
  if (!gn.regular()) return out;
  const double per_degree = residual_per_degree(problem, E);
  if (knowledge == VarianceKnowledge::none) out.residual_scale = per_degree;
  if (knowledge == VarianceKnowledge::weights && per_degree > kClearlyTooLarge)
    out.residual_scale = per_degree;

  FitProblem sandwich;
  std::vector<ArrowSystem> other;
  if (knowledge == VarianceKnowledge::given) {
    sandwich = problem;
    sandwich.W = problem.W.cwiseProduct(problem.W).cwiseProduct(variance);
    other.emplace_back(sandwich, beta, groups, E, FitMethod::gn);
  }
  const Middle K{other.empty() ? gn : other.front(), out.residual_scale};
  const Eigen::MatrixXd inverse = problem.globals() > 0
                                      ? Eigen::MatrixXd(gn.schur().fullPivLu().inverse())
                                      : Eigen::MatrixXd(0, 0);
  out.globals =
      problem.globals() > 0 ? covariance_of_globals(gn, K, inverse) : Eigen::MatrixXd(0, 0);

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
      global_columns(problem, beta, group, c, columns, J_re, J_im);
      J_re -= group.F_re * m.Z;  // the part that numerators cannot follow
      J_im -= group.F_im * m.Z;
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

}  // namespace stageid
