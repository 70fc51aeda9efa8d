#include "estimation/rank_one_search.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace stageid {
namespace {

constexpr double kSpacing = 0.7;  // of a candidate's damping ratio times its frequency
constexpr Eigen::Index kBlock = 64;
constexpr double kLeastOwnShare = 1e-3;  // of a candidate's power that no other function imitates
constexpr int kAlternations = 12;

/// Rows of candidates, a column a channel.
struct Scores {
  Eigen::MatrixXd value;  ///< residual along the candidate, of unit length
  Eigen::MatrixXd size;   ///< of the candidate
};

/// max over u, v of sum 2 z n u v - (n u v)^2: alternating least squares.
double rank_one_gain(const Eigen::MatrixXd& z, const Eigen::MatrixXd& n) {
  const Eigen::MatrixXd zn = z.cwiseProduct(n);
  const Eigen::MatrixXd nn = n.cwiseAbs2();
  Eigen::Index strongest = 0;
  z.rowwise().squaredNorm().maxCoeff(&strongest);
  Eigen::VectorXd v =
      (zn.row(strongest).array() / nn.row(strongest).array().max(1e-300)).matrix().transpose();
  Eigen::VectorXd u(z.rows());
  double gain = 0.0;
  for (int i = 0; i < kAlternations; ++i) {
    u = (zn * v).array() / (nn * v.cwiseAbs2()).array().max(1e-300);
    const Eigen::VectorXd right = zn.transpose() * u;
    const Eigen::VectorXd norm = (nn.transpose() * u.cwiseAbs2()).cwiseMax(1e-300);
    v = right.cwiseQuotient(norm);
    gain = (right.array().square() / norm.array()).sum();
  }
  return gain;
}

Eigen::MatrixXd stacked(const Eigen::MatrixXd& re, const Eigen::MatrixXd& im,
                        const Eigen::VectorXd& weight) {
  Eigen::MatrixXd out(2 * re.rows(), re.cols());
  out << weight.asDiagonal() * re, weight.asDiagonal() * im;
  return out;
}

}  // namespace

std::vector<RankOneMode> rank_one_modes(const FitProblem& problem,
                                        const std::vector<BasisGroup>& groups, const Residual& E,
                                        double damping_ratio) {
  const Eigen::VectorXd& omega = problem.lines.omega_rad_s;
  const Eigen::Index N = problem.size();
  const double low = omega.minCoeff() / (2.0 * std::numbers::pi);
  const double high = omega.maxCoeff() / (2.0 * std::numbers::pi);
  std::vector<RankOneMode> modes;
  for (double f = low; f <= high; f *= 1.0 + kSpacing * damping_ratio)
    modes.push_back({{f, damping_ratio, 1}, 0.0});
  int functions = 1;
  for (const SubmodelShape& shape : problem.shapes)
    if (shape.order == 2 && shape.integrators == 0)
      functions = std::max(functions, shape.functions());
  const SubmodelShape shape{0, 2, functions - 1};
  const auto count = static_cast<Eigen::Index>(modes.size());
  Scores scores{Eigen::MatrixXd(count * functions, problem.channels()),
                Eigen::MatrixXd(count * functions, problem.channels())};

  for (const BasisGroup& group : groups) {
    const LineOperator through(problem.lines, group.delay_s);
    Eigen::MatrixXd re(N, count * functions);
    Eigen::MatrixXd im(N, count * functions);
    parallel_tasks(static_cast<int>(count), problem.threads, [&](int i) {
      const double w =
          2.0 * std::numbers::pi * modes[static_cast<std::size_t>(i)].mode.frequency_hz;
      SubmodelBasis basis;
      evaluate_basis(through, shape, Eigen::Vector2d(2.0 * damping_ratio / w, 1.0 / (w * w)), {},
                     basis);
      re.middleCols(i * functions, functions) = basis.value.re;
      im.middleCols(i * functions, functions) = basis.value.im;
    });
    parallel_tasks(static_cast<int>(group.channels.size()), problem.threads, [&](int member) {
      const Eigen::Index c = group.channels[static_cast<std::size_t>(member)];
      const Eigen::VectorXd root = problem.W.row(c).transpose().cwiseSqrt();
      Eigen::MatrixXd own = stacked(group.F_re, group.F_im, root);
      own *= own.colwise().norm().cwiseMax(1e-300).cwiseInverse().asDiagonal();
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(own);
      own = qr.householderQ() * Eigen::MatrixXd::Identity(own.rows(), own.cols());
      const Eigen::VectorXd rest = stacked(E.re.row(c).transpose(), E.im.row(c).transpose(), root);
      for (Eigen::Index first = 0; first < re.cols(); first += kBlock) {
        const Eigen::Index n = std::min(kBlock, re.cols() - first);
        const Eigen::MatrixXd X = stacked(re.middleCols(first, n), im.middleCols(first, n), root);
        const Eigen::VectorXd total = X.colwise().squaredNorm().transpose();
        const Eigen::MatrixXd imitated = own.transpose() * X;
        const Eigen::VectorXd left = total - imitated.colwise().squaredNorm().transpose();
        const Eigen::VectorXd along = X.transpose() * rest;
        for (Eigen::Index i = 0; i < n; ++i) {
          const bool seen = left[i] > kLeastOwnShare * total[i];
          scores.size(first + i, c) = seen ? std::sqrt(left[i]) : 0.0;
          scores.value(first + i, c) = seen ? along[i] / std::sqrt(left[i]) : 0.0;
        }
      }
    });
  }
  for (Eigen::Index i = 0; i < count * functions; ++i) {
    const auto shaped = [&](const Eigen::MatrixXd& x) -> Eigen::MatrixXd {
      return x.row(i).reshaped(problem.n_outputs, problem.n_inputs);
    };
    double& gain = modes[static_cast<std::size_t>(i / functions)].gain;
    gain = std::max(gain, rank_one_gain(shaped(scores.value), shaped(scores.size)));
  }
  return modes;
}

}  // namespace stageid
