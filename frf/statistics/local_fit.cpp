#include "frf/statistics/local_fit.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

constexpr int kIterations = 8;      // of Sanathanan and Koerner; four or five suffice
constexpr double kSettled = 1e-10;  // relative step of D at which the iteration ends
// Without a pole, the first, linear step lowers the cost by about one degree of freedom. If it lowers the cost only
// a little, the iteration is skipped.
constexpr double kWorthIterating = 0.9;

/// Least squares of Z on the rows of K, group by group, by QR of K^H.
class Projection {
 public:
  Projection(const Eigen::MatrixXcd& K, const Eigen::VectorXcd& k0,
             const std::vector<Eigen::Index>& groups) {
    Eigen::Index first = 0;
    for (const Eigen::Index bins : groups) {
      const Eigen::HouseholderQR<Eigen::MatrixXcd> qr(K.middleCols(first, bins).adjoint());
      Group group{first, qr.householderQ() * Eigen::MatrixXcd::Identity(bins, K.rows()), {}};
      // Theta k0 = (Z Q) R^-H k0.
      group.weight =
          group.Q *
          qr.matrixQR().topRows(K.rows()).triangularView<Eigen::Upper>().adjoint().solve(k0);
      groups_.push_back(std::move(group));
      first += bins;
    }
  }
  Eigen::MatrixXcd fitted(const Eigen::MatrixXcd& Z) const {
    Eigen::MatrixXcd fitted(Z.rows(), Z.cols());
    for (const Group& g : groups_)
      fitted.middleCols(g.first, g.Q.rows()) =
          (Z.middleCols(g.first, g.Q.rows()) * g.Q) * g.Q.adjoint();
    return fitted;
  }
  Eigen::MatrixXcd residual(const Eigen::MatrixXcd& Z) const { return Z - fitted(Z); }
  Eigen::MatrixXcd value(const Eigen::MatrixXcd& Z) const {
    Eigen::MatrixXcd value(Z.rows(), std::ssize(groups_));
    for (std::size_t g = 0; g < groups_.size(); ++g)
      value.col(g) = Z.middleCols(groups_[g].first, groups_[g].Q.rows()) * groups_[g].weight;
    return value;
  }
  Eigen::VectorXcd weight(std::size_t group) const { return groups_[group].weight; }
  Eigen::VectorXd freedom(std::size_t group) const {
    return 1.0 - groups_[group].Q.rowwise().squaredNorm().array();
  }

 private:
  struct Group {
    Eigen::Index first;
    Eigen::MatrixXcd Q;  // bins x p
    Eigen::VectorXcd weight;
  };
  std::vector<Group> groups_;
};

/// Residual degrees of freedom with `poles` poles, over all channels with independent noise.
double degrees_of_freedom(const LocalProblem& problem, int poles) {
  const auto groups = std::ssize(problem.groups);
  return static_cast<double>(problem.tested_noise) *
             static_cast<double>(problem.r.size() - problem.K.rows() * groups) -
         static_cast<double>(poles);
}

/// Ratio of the residual powers with `poles` poles and with `gained` fewer, below which noise alone falls with the
/// requested probability. For one pole P(ratio < x) = x^q, with q degrees of freedom left in all channels with
/// independent noise together, because D is common to them.
double significant_ratio(const LocalProblem& problem, int poles, int gained) {
  return std::pow(problem.chance_of_a_pole,
                  static_cast<double>(gained) / degrees_of_freedom(problem, poles));
}

/// Whether all poles, the zeros of 1 + d_1 r + ..., are at least as wide as required.
bool wide_enough(const LocalProblem& problem, const Eigen::VectorXcd& d) {
  if (!(problem.narrowest_pole > 0.0)) return true;
  const Eigen::Index n = d.size();
  const Eigen::Index bins = problem.groups.front();
  const double distance = (problem.r.head(bins).maxCoeff() - problem.r.head(bins).minCoeff()) /
                          static_cast<double>(bins - 1);
  // The zeros are the inverses of the eigenvalues of this matrix: r^-n + d_1 r^-(n-1) + ... + d_n = 0.
  Eigen::MatrixXcd companion = Eigen::MatrixXcd::Zero(n, n);
  companion.row(0) = -d.transpose();
  for (Eigen::Index i = 1; i < n; ++i) companion(i, i - 1) = 1.0;
  for (const std::complex<double> inverse : eigenvalues(companion))
    if (std::abs((1.0 / inverse).imag()) < problem.narrowest_pole * distance) return false;
  return true;
}

/// sum_c w_c a_c b_c^H.
std::complex<double> product(const Eigen::VectorXd& weight, const Eigen::MatrixXcd& a,
                             const Eigen::MatrixXcd& b) {
  const Eigen::VectorXcd sums = (a.array() * b.conjugate().array()).rowwise().sum().matrix();
  return weight.cast<std::complex<double>>().dot(sums);
}

/// Normal equations of the next d_1, ..., d_n: normal d = right; the cost of d is cost - right^H d.
struct DenominatorStep {
  Eigen::MatrixXcd normal;
  Eigen::VectorXcd right;
  double cost = 0.0;  // of d = 0

  /// The first `poles` coefficients; `linear_cost`: the remaining cost.
  Eigen::VectorXcd solution(Eigen::Index poles, double& linear_cost) const {
    Eigen::VectorXcd d = normal.topLeftCorner(poles, poles).fullPivLu().solve(right.head(poles));
    linear_cost = cost - right.head(poles).dot(d).real();
    return d;
  }
};

class Fitting {
 public:
  Fitting(const LocalProblem& problem, int most_poles)
      : p_(problem), powers_(problem.r.size(), most_poles + 1) {
    powers_.col(0).setOnes();
    for (Eigen::Index i = 1; i <= most_poles; ++i)
      powers_.col(i) = powers_.col(i - 1) * p_.r.array();
    const Projection projection(p_.K, p_.k0, p_.groups);
    polynomial_ = fit(Eigen::VectorXcd(), projection);
    // Units and noise differ, so every channel is weighted by its own residual.
    weight_ = polynomial_.residual.topRows(p_.pole_channels).rowwise().squaredNorm();
    weight_ = (weight_.array() > 0.0).select(weight_.cwiseInverse(), 0.0);
    first_step_ = denominator_step(p_.Z.topRows(p_.pole_channels), projection, most_poles);
  }

  const LocalFit& polynomial() const { return polynomial_; }
  double cost(const LocalFit& fit) const {
    return weight_.dot(fit.residual.topRows(p_.pole_channels).rowwise().squaredNorm());
  }

  /// The fit with `poles` poles; the polynomial fit if the first step does not indicate a pole or the iteration breaks
  /// down.
  LocalFit with_poles(int poles) const {
    // At least half way to significance.
    const double worth =
        std::max(kWorthIterating, 0.5 * (1.0 + significant_ratio(p_, poles, poles)));
    // The iteration starts at D = 1 for any number of poles.
    double linear_cost = 0.0;
    Eigen::VectorXcd d = first_step_.solution(poles, linear_cost);
    if (linear_cost > worth * first_step_.cost) return polynomial_;
    for (int i = 1; i < kIterations && d.allFinite(); ++i) {
      const Eigen::VectorXcd before = std::exchange(d, next_denominator(d));
      if ((d - before).norm() <= kSettled * d.norm()) break;
    }
    if (!d.allFinite() || !wide_enough(p_, d)) return polynomial_;
    LocalFit rational = fit(d, Projection(over(p_.K, denominator(d)), p_.k0, p_.groups));
    return rational.residual.allFinite() ? rational : polynomial_;
  }

 private:
  Eigen::ArrayXcd denominator(const Eigen::VectorXcd& d) const {
    Eigen::ArrayXcd D = Eigen::ArrayXcd::Ones(p_.r.size());
    for (Eigen::Index i = 0; i < d.size(); ++i) D += d[i] * powers_.col(i + 1);
    return D;
  }

  Eigen::MatrixXcd over(const Eigen::MatrixXcd& rows, const Eigen::ArrayXcd& D) const {
    return rows * D.inverse().matrix().asDiagonal();
  }

  Eigen::MatrixXcd times_power(const Eigen::MatrixXcd& rows, Eigen::Index power) const {
    return rows * powers_.col(power).matrix().asDiagonal();
  }

  /// Least squares in d and Theta of (D Z - Theta K) / D_previous; Z and `projection` include D_previous.
  DenominatorStep denominator_step(const Eigen::MatrixXcd& Z, const Projection& projection,
                                   Eigen::Index poles) const {
    const Eigen::MatrixXcd e = projection.residual(Z);
    std::vector<Eigen::MatrixXcd> x;
    for (Eigen::Index i = 0; i < poles; ++i)
      x.push_back(projection.residual(times_power(Z, i + 1)));
    DenominatorStep step{Eigen::MatrixXcd(poles, poles), Eigen::VectorXcd(poles),
                         product(weight_, e, e).real()};
    for (Eigen::Index i = 0; i < poles; ++i) {
      const auto& x_i = x[i];
      step.right[i] = -product(weight_, e, x_i);
      step.normal(i, i) = product(weight_, x_i, x_i).real();
      for (Eigen::Index j = 0; j < i; ++j) {
        step.normal(i, j) = product(weight_, x[j], x_i);
        step.normal(j, i) = std::conj(step.normal(i, j));
      }
    }
    return step;
  }

  Eigen::VectorXcd next_denominator(const Eigen::VectorXcd& previous) const {
    const Eigen::ArrayXcd D = denominator(previous);
    const Projection projection(over(p_.K, D), p_.k0, p_.groups);
    double linear_cost = 0.0;
    return denominator_step(over(p_.Z.topRows(p_.pole_channels), D), projection, previous.size())
        .solution(previous.size(), linear_cost);
  }

  LocalFit fit(const Eigen::VectorXcd& d, const Projection& projection) const {
    const auto groups = std::ssize(p_.groups);
    LocalFit result;
    result.poles = static_cast<int>(d.size());
    result.value = projection.value(p_.Z);
    const Eigen::MatrixXcd fitted = projection.fitted(p_.Z);
    result.residual = p_.Z - fitted;
    result.weight.resize(p_.r.size());
    result.freedom.resize(p_.r.size());
    result.leverage.resize(groups);
    Eigen::Index first = 0;
    for (Eigen::Index g = 0; g < groups; ++g) {
      const Eigen::VectorXcd weight = projection.weight(static_cast<std::size_t>(g));
      result.weight.segment(first, weight.size()) = weight;
      result.freedom.segment(first, weight.size()) =
          projection.freedom(static_cast<std::size_t>(g));
      result.leverage[g] = weight.squaredNorm();
      first += weight.size();
    }
    // D is common to all channels, so a pole uses one degree of freedom of all together.
    result.dof = static_cast<double>(p_.r.size() - p_.K.rows() * groups) -
                 static_cast<double>(d.size()) / static_cast<double>(p_.independent_noise);
    result.variance_dof = result.dof;
    if (d.size() > 0)
      result.pole_spread = pole_spread(projection, fitted, denominator(d), d.size(), result);
    return result;
  }

  /// A factor of g Cov(d) g^H: g_i = d value / d d_i, Cov(d) from the curvature of the cost. The rank of the channels'
  /// noise is the number of outputs, so only that many channels count.
  Eigen::MatrixXcd pole_spread(const Projection& projection, const Eigen::MatrixXcd& fitted,
                               const Eigen::ArrayXcd& D, Eigen::Index poles,
                               const LocalFit& fit) const {
    const Eigen::VectorXd variance =
        fit.residual.topRows(p_.pole_channels).rowwise().squaredNorm() / fit.dof;
    const Eigen::VectorXd weight = (variance.array() > 0.0).select(variance.cwiseInverse(), 0.0);
    Eigen::MatrixXcd g(fit.value.size(), poles);
    std::vector<Eigen::MatrixXcd> x;
    for (Eigen::Index i = 0; i < poles; ++i) {
      const Eigen::MatrixXcd slope = over(times_power(fitted, i + 1), D);
      g.col(i) = projection.value(slope).reshaped();
      x.push_back(projection.residual(slope.topRows(p_.pole_channels)));
    }
    Eigen::MatrixXcd information(poles, poles);
    for (Eigen::Index i = 0; i < poles; ++i) {
      for (Eigen::Index j = 0; j < poles; ++j) {
        information(i, j) = product(weight, x[j], x[i]);
      }
    }
    information *=
        static_cast<double>(p_.independent_noise) / static_cast<double>(p_.pole_channels);
    // NaN for poles that the data do not determine: rejected.
    return g * inverse_cholesky(information).adjoint();
  }

  const LocalProblem& p_;
  Eigen::ArrayXXd powers_;  // B x (most poles + 1): 1, r, r^2, ...
  LocalFit polynomial_;
  Eigen::VectorXd weight_;
  DenominatorStep first_step_;
};

/// Degrees of freedom of the mean of the fits' variances, from those of each fit and from their differences.
double variance_dof(const LocalProblem& problem, const std::vector<LocalFit>& fits,
                    const Eigen::ArrayXd& share) {
  Eigen::ArrayXXd variance(problem.pole_channels, share.size());
  for (Eigen::Index n = 0; n < share.size(); ++n) {
    const LocalFit& fit = fits[n];
    variance.col(n) = fit.residual.topRows(problem.pole_channels).rowwise().squaredNorm() / fit.dof;
  }
  const Eigen::ArrayXd mean = variance.matrix() * share.matrix();
  if (!(mean.minCoeff() > 0.0)) return fits.front().dof;
  double scarcity = 0.0;
  for (Eigen::Index n = 0; n < share.size(); ++n) {
    const Eigen::ArrayXd ratio = variance.col(n) / mean;
    scarcity += share[n] * (ratio.square() / fits[n].dof + (ratio - 1.0).square()).mean();
  }
  return 1.0 / scarcity;
}

/// ln of the probability of each fit up to a constant: residual power^-(degrees of freedom), times the prior odds of
/// its poles.
Eigen::ArrayXd log_probability(const LocalProblem& problem, const Fitting& fitting,
                               const std::vector<LocalFit>& fits) {
  Eigen::ArrayXd log_p(std::ssize(fits));
  for (Eigen::Index n = 0; n < log_p.size(); ++n) {
    const LocalFit& fit = fits[n];
    const double cost = std::max(fitting.cost(fit), std::numeric_limits<double>::min());
    log_p[n] = fit.poles * std::log(problem.chance_of_a_pole) -
               degrees_of_freedom(problem, fit.poles) * std::log(cost);
  }
  return log_p;
}

}  // namespace

void set_polynomials(LocalProblem& problem, Eigen::Index order) {
  problem.K.resize(order + 1, problem.r.size());
  for (Eigen::Index i = 0; i < problem.r.size(); ++i)
    for (Eigen::Index q = 0; q <= order; ++q)
      problem.K(q, i) = std::pow(problem.r[i], static_cast<double>(q));
  problem.k0 = Eigen::VectorXcd::Unit(order + 1, 0);
}

LocalFit fit_locally(const LocalProblem& problem, int most_poles) {
  const Fitting fitting(problem, most_poles);
  LocalFit best = fitting.polynomial();
  double cost = fitting.cost(best);
  for (int poles = 1; poles <= most_poles; ++poles) {
    LocalFit candidate = fitting.with_poles(poles);
    if (candidate.poles != poles || !candidate.pole_spread.allFinite()) continue;
    const double smaller = fitting.cost(candidate);
    if (!(smaller < cost * significant_ratio(problem, poles, poles - best.poles))) continue;
    best = std::move(candidate);
    cost = smaller;
  }
  return best;
}

LocalFit average_locally(const LocalProblem& problem, int most_poles) {
  const Fitting fitting(problem, most_poles);
  std::vector<LocalFit> fits = {fitting.polynomial()};
  Eigen::Index columns = 0;
  for (int poles = 1; poles <= most_poles; ++poles) {
    LocalFit fit = fitting.with_poles(poles);
    if (fit.poles != poles || !fit.pole_spread.allFinite()) continue;
    columns += poles;
    fits.push_back(std::move(fit));
  }
  if (fits.size() == 1) return std::move(fits.front());
  const Eigen::ArrayXd log_p = log_probability(problem, fitting, fits);
  const Eigen::ArrayXd likely = (log_p - log_p.maxCoeff()).exp();
  const Eigen::ArrayXd share = likely / likely.sum();

  const Eigen::Index B = problem.r.size();
  const Eigen::Index channels = problem.Z.rows();
  LocalFit mean;
  mean.value.setZero(channels, std::ssize(problem.groups));
  mean.weight.setZero(B);
  mean.leverage.setZero(mean.value.cols());
  mean.residual.resize(channels, B * share.size());
  for (Eigen::Index n = 0; n < share.size(); ++n) {
    const LocalFit& fit = fits[n];
    mean.value += share[n] * fit.value;
    mean.weight += share[n] * fit.weight;
    mean.leverage += share[n] * fit.leverage;
    mean.dof += share[n] * fit.dof;
    mean.residual.middleCols(B * n, B) = std::sqrt(share[n]) * fit.residual;
    mean.poles = fit.poles;
  }
  mean.variance_dof = variance_dof(problem, fits, share);
  mean.pole_spread.resize(mean.value.size(), columns + share.size());
  Eigen::Index column = 0;
  for (Eigen::Index n = 0; n < share.size(); ++n) {
    const LocalFit& fit = fits[n];
    const double root = std::sqrt(share[n]);
    mean.pole_spread.col(column++) = root * (fit.value - mean.value).reshaped();
    if (fit.poles == 0) continue;
    mean.pole_spread.middleCols(column, fit.poles) = root * fit.pole_spread;
    column += fit.poles;
  }
  return mean;
}

}  // namespace stageid
