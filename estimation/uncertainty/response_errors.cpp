#include "estimation/uncertainty/response_errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "estimation/products/channel_equations.hpp"
#include "estimation/uncertainty/parameter_covariance.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

constexpr double kOutside = 0.05;

double probability_above(double r, double relation) {
  constexpr int kPoints = 200;  // the midpoint rule of a smooth periodic function
  double sum = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const double t = (i + 0.5) / kPoints * std::numbers::pi / 2.0;
    const double along = (1.0 + relation) * std::pow(std::cos(t), 2);
    sum += std::exp(-r * r / (along + (1.0 - relation) * std::pow(std::sin(t), 2)));
  }
  return sum / kPoints;
}

/// error_quantile_95() interpolated in a table, within 1e-5.
class QuantileTable {
 public:
  QuantileTable() {
    for (std::size_t i = 0; i < values_.size(); ++i)
      values_[i] = error_quantile_95(static_cast<double>(i) / kIntervals);
  }
  double operator()(double relation) const {
    const double x = std::clamp(relation, 0.0, 1.0) * kIntervals;
    const auto i = std::min(static_cast<std::size_t>(x), std::size_t{kIntervals - 1});
    return std::lerp(values_[i], values_[i + 1], x - static_cast<double>(i));
  }

 private:
  static constexpr int kIntervals = 256;
  std::array<double, kIntervals + 1> values_{};
};

/// The parameters that a channel's response depends on.
std::vector<Eigen::Index> own_parameters(const FitProblem& problem, Eigen::Index c) {
  std::vector<Eigen::Index> own(static_cast<std::size_t>(problem.globals()));
  std::iota(own.begin(), own.end(), Eigen::Index{0});
  for (Eigen::Index f = 0; f < problem.functions(); ++f)
    own.push_back(problem.globals() + c + problem.channels() * f);
  return own;
}

}  // namespace

double error_quantile_95(double relation) {
  double low = 1.0;
  double high = 3.0;
  while (high - low > 1e-9) {
    const double middle = 0.5 * (low + high);
    (probability_above(middle, relation) > kOutside ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void fill_response_errors(const FitProblem& problem, const FitParameters& beta,
                          const std::vector<BasisGroup>& groups, FitCovariance& covariance) {
  const QuantileTable quantile;
  const std::vector<const BasisGroup*> group_of = groups_of_channels(problem, groups);
  const std::vector<DerivativeColumn> columns = derivative_columns(problem);
  covariance.response_variance.resize(problem.channels(), problem.size());
  covariance.response_radius.resize(problem.channels(), problem.size());
  for_each_task(problem.threads, static_cast<int>(problem.channels()), [&](int c) {
    const BasisGroup& group = *group_of[static_cast<std::size_t>(c)];
    const std::vector<Eigen::Index> own = own_parameters(problem, c);
    const Eigen::MatrixXd C = covariance.sandwich(own, own);
    const Eigen::Index globals = problem.globals();
    Eigen::MatrixXd re;
    Eigen::MatrixXd im;
    for (Eigen::Index first = 0; first < problem.size(); first += kTileLines) {
      const LineRange lines = {first, std::min(kTileLines, problem.size() - first)};
      global_columns(problem, beta, group, c, columns, lines, re, im);
      re.conservativeResize(Eigen::NoChange, C.rows());
      im.conservativeResize(Eigen::NoChange, C.rows());
      re.rightCols(C.rows() - globals) = group.F_re.middleRows(first, lines.count);
      im.rightCols(C.rows() - globals) = group.F_im.middleRows(first, lines.count);
      const Eigen::MatrixXd half = re * C;
      const Eigen::ArrayXd real = half.cwiseProduct(re).rowwise().sum();
      const Eigen::ArrayXd imaginary = (im * C).cwiseProduct(im).rowwise().sum();
      const Eigen::ArrayXd between = half.cwiseProduct(im).rowwise().sum();
      for (Eigen::Index i = 0; i < lines.count; ++i) {
        const double variance = std::max(real[i] + imaginary[i], 0.0);
        const double relation = std::hypot(real[i] - imaginary[i], 2.0 * between[i]);
        covariance.response_variance(c, first + i) = variance;
        covariance.response_radius(c, first + i) =
            std::sqrt(variance) * quantile(variance > 0.0 ? relation / variance : 0.0);
      }
    }
  });
}

}  // namespace stageid
