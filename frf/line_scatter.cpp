#include "frf/line_scatter.hpp"

#include <algorithm>
#include <vector>

#include "frf/local_fit.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kOrder = 2;
constexpr int kMostPoles = 2;  // two modes close to each other
constexpr Eigen::Index kDof = 9;
constexpr Eigen::Index kWindow = kOrder + 1 + kDof;

LocalFit fit_around(const FrfEstimate& frf, Eigen::Index k) {
  const Eigen::Index first = std::clamp<Eigen::Index>(k - kWindow / 2, 0, frf.lines() - kWindow);
  const Eigen::ArrayXd away =
      frf.frequency_hz.segment(first, kWindow).array() - frf.frequency_hz[k];
  LocalProblem problem;
  problem.Z = frf.response.middleCols(first, kWindow);
  problem.r = (away / away.abs().maxCoeff()).matrix();
  problem.groups = {kWindow};
  problem.independent_noise = problem.pole_channels = frf.response.rows();
  problem.K.resize(kOrder + 1, kWindow);
  for (Eigen::Index i = 0; i <= kOrder; ++i)
    problem.K.row(i) = problem.r.array()
                           .pow(static_cast<double>(i))
                           .matrix()
                           .cast<std::complex<double>>()
                           .transpose();
  problem.k0 = Eigen::VectorXcd::Unit(kOrder + 1, 0);
  return fit_locally(problem, kMostPoles);
}

double median_ratio(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  if (a.size() == 0 || b.size() != a.size()) return 0.0;
  std::vector<double> ratios;
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (b.data()[i] > 0.0) ratios.push_back(a.data()[i] / b.data()[i]);
  if (ratios.empty()) return 0.0;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

}  // namespace

LineScatter line_scatter(const FrfEstimate& frf) {
  LineScatter scatter;
  if (frf.lines() < kWindow) return scatter;
  scatter.variance.resize(frf.response.rows(), frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const LocalFit fit = fit_around(frf, k);
    scatter.variance.col(k) = fit.residual.rowwise().squaredNorm() / fit.dof;
  }
  scatter.dof = static_cast<double>(kDof);
  scatter.over_noise = median_ratio(scatter.variance, frf.noise_variance);
  return scatter;
}

}  // namespace stageid
