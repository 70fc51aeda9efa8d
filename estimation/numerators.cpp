#include "estimation/numerators.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "estimation/weighted_products.hpp"

namespace stageid {
namespace {

/// Solves the scaled normal equations of one channel.
class ScaledNormalEquations {
 public:
  explicit ScaledNormalEquations(const Eigen::MatrixXd& M) {
    scale_ = M.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale_.asDiagonal() * M * scale_.asDiagonal();
    // Far below the rounding of the sums: only keeps the factorization of coinciding poles alive.
    scaled.diagonal().array() += 1e-14;
    factor_.compute(scaled);
  }
  bool ok() const { return factor_.info() == Eigen::Success; }
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const {
    return scale_.asDiagonal() * factor_.solve(scale_.asDiagonal() * b);
  }

 private:
  Eigen::VectorXd scale_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

/// Of every channel of a group.
std::vector<ScaledNormalEquations> normal_equations(const FitProblem& problem,
                                                    const BasisGroup& group) {
  const Eigen::Index n_f = problem.functions();
  const auto pairs = triangular_pairs(n_f);
  const Eigen::MatrixXd W = rows_of(problem.W, group.channels);
  const Eigen::MatrixXd gram = weighted_pair_sums(W, {group.F_re, group.F_im},
                                                  {group.F_re, group.F_im}, pairs, problem.threads);
  std::vector<ScaledNormalEquations> out;
  out.reserve(group.channels.size());
  Eigen::MatrixXd M(n_f, n_f);
  for (Eigen::Index c = 0; c < gram.rows(); ++c) {
    for (std::size_t p = 0; p < pairs.size(); ++p)
      M(pairs[p].left, pairs[p].right) = M(pairs[p].right, pairs[p].left) =
          gram(c, static_cast<Eigen::Index>(p));
    out.emplace_back(M);
  }
  return out;
}

}  // namespace

bool solve_numerators(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                      Eigen::MatrixXd& B, Residual& E) {
  B.setZero(problem.channels(), problem.functions());
  std::vector<std::vector<ScaledNormalEquations>> factors;
  for (const BasisGroup& group : groups) {
    factors.push_back(normal_equations(problem, group));
    for (const ScaledNormalEquations& channel : factors.back())
      if (!channel.ok()) return false;
  }
  // The first pass solves, the second refines with the residual itself.
  E = residual(problem, groups, B);
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const Eigen::MatrixXd e = numerator_gradient(problem, groups[g], E);
      for (std::size_t c = 0; c < groups[g].channels.size(); ++c)
        B.row(groups[g].channels[c]) +=
            factors[g][c].solve(e.row(static_cast<Eigen::Index>(c)).transpose()).transpose();
    }
    E = residual(problem, groups, B);
  }
  return std::isfinite(E.cost);
}

std::vector<double> removal_costs(const FitProblem& problem, const std::vector<BasisGroup>& groups,
                                  const Eigen::MatrixXd& B) {
  const Eigen::Index n_f = problem.functions();
  std::vector<double> costs(problem.shapes.size(), 0.0);
  for (const BasisGroup& group : groups) {
    const std::vector<ScaledNormalEquations> factors = normal_equations(problem, group);
    for (std::size_t c = 0; c < factors.size(); ++c) {
      if (!factors[c].ok()) continue;
      const Eigen::MatrixXd inverse = factors[c].solve(Eigen::MatrixXd::Identity(n_f, n_f));
      Eigen::Index f = 0;
      for (std::size_t i = 0; i < problem.shapes.size(); ++i) {
        const Eigen::Index n = problem.shapes[i].functions();
        const Eigen::VectorXd b = B.row(group.channels[c]).segment(f, n).transpose();
        costs[i] += b.dot(Eigen::MatrixXd(inverse.block(f, f, n, n)).llt().solve(b));
        f += n;
      }
    }
  }
  return costs;
}

}  // namespace stageid
