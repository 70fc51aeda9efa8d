#include "frf/local_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <utility>
#include <vector>

namespace stageid {
namespace {

constexpr int kIterations = 8;           // of Sanathanan and Koerner; they settle in four or five
constexpr double kChanceOfAPole = 0.05;  // that noise alone is taken for one
// Without a pole the first, linear step lowers the cost by one degree of freedom of many: a line on
// which it does not do much more is not worth the iteration.
constexpr double kWorthIterating = 0.9;

/// Least squares of Z on the rows of K, by QR of K^H.
struct Projection {
  Eigen::MatrixXcd Q;  // B x p
  Eigen::VectorXcd y;  // Theta k0 = (Z Q) y

  Projection(const Eigen::MatrixXcd& K, const Eigen::VectorXcd& k0) {
    const Eigen::HouseholderQR<Eigen::MatrixXcd> qr(K.adjoint());
    Q = qr.householderQ() * Eigen::MatrixXcd::Identity(K.cols(), K.rows());
    y = qr.matrixQR().topRows(K.rows()).triangularView<Eigen::Upper>().adjoint().solve(k0);
  }
  Eigen::MatrixXcd fitted(const Eigen::MatrixXcd& Z) const { return (Z * Q) * Q.adjoint(); }
  Eigen::MatrixXcd residual(const Eigen::MatrixXcd& Z) const { return Z - fitted(Z); }
  Eigen::VectorXcd value(const Eigen::MatrixXcd& Z) const { return (Z * Q) * y; }
};

/// sum_c w_c a_c b_c^H.
std::complex<double> product(const Eigen::VectorXd& weight, const Eigen::MatrixXcd& a,
                             const Eigen::MatrixXcd& b) {
  const Eigen::VectorXcd sums = (a.array() * b.conjugate().array()).rowwise().sum().matrix();
  return weight.cast<std::complex<double>>().dot(sums);
}

class Fitting {
 public:
  explicit Fitting(const LocalProblem& problem) : p_(problem) {
    polynomial_ = fit(Eigen::VectorXcd());
    // Units differ, and so does the noise: every channel counts by its own.
    weight_ = polynomial_.residual.rowwise().squaredNorm();
    weight_ = (weight_.array() > 0.0).select(weight_.cwiseInverse(), 0.0);
  }

  const LocalFit& polynomial() const { return polynomial_; }
  double cost(const LocalFit& fit) const {
    return weight_.dot(fit.residual.rowwise().squaredNorm());
  }

  /// The fit with `poles` poles; the polynomial one if the first step shows no sign of a pole, or
  /// the iteration breaks down.
  LocalFit with_poles(int poles) const {
    Eigen::VectorXcd d = Eigen::VectorXcd::Zero(poles);
    for (int i = 0; i < kIterations; ++i) {
      double linear_cost = 0.0;
      d = next_denominator(d, linear_cost);
      if (!d.allFinite()) return polynomial_;
      if (i == 0 && linear_cost > kWorthIterating * cost(polynomial_)) return polynomial_;
    }
    LocalFit rational = fit(d);
    return rational.residual.allFinite() ? rational : polynomial_;
  }

 private:
  Eigen::ArrayXcd denominator(const Eigen::VectorXcd& d) const {
    Eigen::ArrayXcd D = Eigen::ArrayXcd::Ones(p_.r.size());
    for (Eigen::Index i = 0; i < d.size(); ++i) {
      D += d[i] * p_.r.array().pow(static_cast<double>(i + 1));
    }
    return D;
  }

  Eigen::MatrixXcd over(const Eigen::MatrixXcd& rows, const Eigen::ArrayXcd& D) const {
    return rows * D.inverse().matrix().asDiagonal();
  }

  Eigen::MatrixXcd times_power(const Eigen::MatrixXcd& rows, Eigen::Index power) const {
    return rows * p_.r.array().pow(static_cast<double>(power)).matrix().asDiagonal();
  }

  /// Least squares in d and Theta of (D Z - Theta K) / D_previous.
  Eigen::VectorXcd next_denominator(const Eigen::VectorXcd& previous, double& linear_cost) const {
    const Eigen::ArrayXcd D = denominator(previous);
    const Projection projection(over(p_.K, D), p_.k0);
    const Eigen::MatrixXcd Z = over(p_.Z, D);
    const Eigen::MatrixXcd e = projection.residual(Z);
    std::vector<Eigen::MatrixXcd> x;
    for (Eigen::Index i = 0; i < previous.size(); ++i) {
      x.push_back(projection.residual(times_power(Z, i + 1)));
    }
    Eigen::MatrixXcd normal(previous.size(), previous.size());
    Eigen::VectorXcd right(previous.size());
    for (Eigen::Index i = 0; i < previous.size(); ++i) {
      const auto xi = static_cast<std::size_t>(i);
      right[i] = -product(weight_, e, x[xi]);
      for (Eigen::Index j = 0; j < previous.size(); ++j) {
        normal(i, j) = product(weight_, x[static_cast<std::size_t>(j)], x[xi]);
      }
    }
    const Eigen::VectorXcd d = normal.fullPivLu().solve(right);
    linear_cost = product(weight_, e, e).real() - right.dot(d).real();
    return d;
  }

  LocalFit fit(const Eigen::VectorXcd& d) const {
    const Eigen::ArrayXcd D = denominator(d);
    const Projection projection(over(p_.K, D), p_.k0);
    LocalFit result;
    result.poles = static_cast<int>(d.size());
    result.value = projection.value(p_.Z);
    const Eigen::MatrixXcd fitted = projection.fitted(p_.Z);
    result.residual = p_.Z - fitted;
    result.leverage = projection.y.squaredNorm();
    // One D for all channels takes a degree of freedom from them together.
    result.dof = static_cast<double>(p_.r.size() - p_.K.rows()) -
                 static_cast<double>(d.size()) / static_cast<double>(p_.independent_noise);
    if (d.size() > 0) result.pole_spread = pole_spread(projection, fitted, D, d.size(), result);
    return result;
  }

  /// A factor of g Cov(d) g^H: g_i = d value / d d_i, Cov(d) from the curvature of the cost. The
  /// channels' noise has the rank of the outputs only, so that many of them count.
  Eigen::MatrixXcd pole_spread(const Projection& projection, const Eigen::MatrixXcd& fitted,
                               const Eigen::ArrayXcd& D, Eigen::Index poles,
                               const LocalFit& fit) const {
    const Eigen::VectorXd variance = fit.residual.rowwise().squaredNorm() / fit.dof;
    const Eigen::VectorXd weight = (variance.array() > 0.0).select(variance.cwiseInverse(), 0.0);
    Eigen::MatrixXcd g(p_.Z.rows(), poles);
    std::vector<Eigen::MatrixXcd> x;
    for (Eigen::Index i = 0; i < poles; ++i) {
      const Eigen::MatrixXcd slope = over(times_power(fitted, i + 1), D);
      g.col(i) = projection.value(slope);
      x.push_back(projection.residual(slope));
    }
    Eigen::MatrixXcd information(poles, poles);
    for (Eigen::Index i = 0; i < poles; ++i) {
      for (Eigen::Index j = 0; j < poles; ++j) {
        information(i, j) =
            product(weight, x[static_cast<std::size_t>(j)], x[static_cast<std::size_t>(i)]);
      }
    }
    information *= static_cast<double>(p_.independent_noise) / static_cast<double>(p_.Z.rows());
    const Eigen::LLT<Eigen::MatrixXcd> factor(information);
    return factor.matrixL().solve(g.adjoint()).adjoint();
  }

  const LocalProblem& p_;
  LocalFit polynomial_;
  Eigen::VectorXd weight_;
};

}  // namespace

LocalFit fit_locally(const LocalProblem& problem, int most_poles) {
  const Fitting fitting(problem);
  LocalFit best = fitting.polynomial();
  double cost = fitting.cost(best);
  for (int poles = 1; poles <= most_poles; ++poles) {
    LocalFit candidate = fitting.with_poles(poles);
    if (candidate.poles != poles || !candidate.pole_spread.allFinite()) continue;
    // Residual powers of nested complex fits: P(ratio < x) = x^q with q degrees of freedom left.
    const double left = static_cast<double>(problem.r.size() - problem.K.rows() - poles);
    const double gained = poles - best.poles;
    const double smaller = fitting.cost(candidate);
    if (!(smaller < cost * std::pow(kChanceOfAPole, gained / left))) continue;
    best = std::move(candidate);
    cost = smaller;
  }
  return best;
}

}  // namespace stageid
