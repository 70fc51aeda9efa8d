#include "estimation/uncertainty/data_noise.hpp"

namespace stageid {
namespace {

/// A larger residual cannot be noise alone.
constexpr double kClearlyTooLarge = 1.5;

}  // namespace

DataNoise data_noise(const FrfEstimate& frf, Weighting weighting) {
  const Eigen::MatrixXd& known =
      frf.total_variance.size() > 0 ? frf.total_variance : frf.noise_variance;
  const auto [first, count] = frf.own();
  DataNoise noise;
  // The weights are from the noise variance, but the estimate of a nonlinear plant has a larger scatter.
  const bool distorted = weighting != Weighting::total_variance && frf.total_variance.size() > 0 &&
                         frf.nonlinearity.nonlinear();
  if (weighs_by_variance(weighting) && !distorted) {
    noise.knowledge = VarianceKnowledge::weights;
    noise.variance = weighed_variance(frf, weighting);
  } else if (known.size() > 0 && !frf.any((known.middleRows(first, count).array() <= 0.0).any())) {
    noise.knowledge = VarianceKnowledge::given;
    noise.variance =
        LineVariance{SharedMatrix<Eigen::MatrixXd>::kept(known), Eigen::ArrayXd::Ones(frf.lines())};
  }
  if (noise.knowledge != VarianceKnowledge::none) noise.correlation = NoiseCorrelation(frf);
  return noise;
}

SplitMatrix noise_scaled(const FitProblem& problem, const DataNoise& noise, Eigen::Index c,
                         DataRange lines, SplitMatrix columns) {
  Eigen::ArrayXd scale = problem.W->row(c).segment(lines.first, lines.count).transpose();
  if (noise.variance) {
    const auto variance = noise.variance->matrix->row(c).segment(lines.first, lines.count);
    const auto divisor = noise.variance->divisor.segment(lines.first, lines.count);
    scale *= (variance.transpose().array() / divisor).sqrt();
  } else {
    scale = scale.sqrt().eval();
  }
  columns.re.array().colwise() *= scale;
  columns.im.array().colwise() *= scale;
  return columns;
}

FitProblem middle_problem(const FitProblem& problem, const DataNoise& noise) {
  FitProblem middle = problem;
  middle.middle = noise.variance;
  return middle;
}

double covariance_scale(const FitProblem& problem, double cost, Eigen::Index parameters,
                        VarianceKnowledge knowledge) {
  if (knowledge == VarianceKnowledge::given) return 1.0;
  const double per_degree = residual_per_degree(problem, cost, parameters);
  const bool likelihood = knowledge == VarianceKnowledge::weights;
  return likelihood && per_degree < kClearlyTooLarge ? 1.0 : per_degree;
}

}  // namespace stageid
