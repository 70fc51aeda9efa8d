#include "frf/response/neighbour_scatter.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>
#include <vector>

#include "excitation/threads/worker_pool.hpp"
#include "frf/statistics/local_fit.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kOrder = 2;
constexpr int kMostPoles = 2;  // two close modes
constexpr Eigen::Index kWindow = kOrder + 1 + kScatterDof;

// Medians. For errors independent of the line distance, the first ratio is 1; for a response beyond the quadratic
// model it is 2^6.
constexpr double kMostByDistance = 3.0;
constexpr double kMostOfResponse = 0.04;

LocalFit fit_around(const Eigen::VectorXd& frequency_hz, const Eigen::MatrixXcd& lines,
                    Eigen::Index k) {
  const Eigen::Index first = std::clamp<Eigen::Index>(k - kWindow / 2, 0, lines.cols() - kWindow);
  const Eigen::ArrayXd away = frequency_hz.segment(first, kWindow).array() - frequency_hz[k];
  LocalProblem problem;
  problem.Z = lines.middleCols(first, kWindow);
  problem.r = (away / away.abs().maxCoeff()).matrix();
  problem.groups = {kWindow};
  problem.independent_noise = problem.pole_channels = lines.rows();
  set_polynomials(problem, kOrder);
  return fit_locally(problem, kMostPoles);
}

/// Calls use(a / b) for all b > 0.
template <typename Use>
void for_each_ratio(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const Use& use) {
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (b.data()[i] > 0.0) use(a.data()[i] / b.data()[i]);
}

/// Nonnegative numbers have the same order as their bits: exponent and four bits of the fraction.
std::size_t bin_of(double ratio) { return std::bit_cast<std::uint64_t>(ratio) >> 48; }

/// The upper median of nonnegative ratios. To save memory, they are first counted in bins, and only those of the
/// middle bin are stored.
double median_ratio(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  if (a.size() == 0 || b.size() != a.size()) return 0.0;
  std::vector<std::size_t> counts(std::size_t{1} << 16);
  for_each_ratio(a, b, [&](double ratio) { ++counts[bin_of(ratio)]; });
  std::size_t rank = std::accumulate(counts.begin(), counts.end(), std::size_t{0}) / 2;
  std::size_t bin = 0;
  while (bin < counts.size() && rank >= counts[bin]) rank -= counts[bin++];
  if (bin == counts.size()) return 0.0;
  std::vector<double> ratios;
  ratios.reserve(counts[bin]);
  for_each_ratio(a, b, [&](double ratio) {
    if (bin_of(ratio) == bin) ratios.push_back(ratio);
  });
  return value_of_rank(ratios, rank);
}

}  // namespace

bool has_line_scatter(Eigen::Index lines) noexcept { return lines >= kWindow; }

Eigen::MatrixXd scatter_variance(const Eigen::VectorXd& frequency_hz, const Eigen::MatrixXcd& lines,
                                 int threads) {
  if (!has_line_scatter(lines.cols())) return {};
  Eigen::MatrixXd variance(lines.rows(), lines.cols());
  for_each_line(worker_count(threads), lines.cols(), [&](Eigen::Index k) {
    const LocalFit fit = fit_around(frequency_hz, lines, k);
    variance.col(k) = fit.residual.rowwise().squaredNorm() / fit.dof;
  });
  return variance;
}

LineScatter line_scatter(const FrfEstimate& frf, int threads) {
  LineScatter scatter;
  scatter.variance = scatter_variance(frf.frequency_hz, frf.response, threads);
  if (scatter.variance.size() == 0) return scatter;
  scatter.dof = static_cast<double>(kScatterDof);
  scatter.over_noise = median_ratio(scatter.variance, frf.noise_variance);
  return scatter;
}

bool lines_are_coarse(const FrfEstimate& frf, const LineScatter& scatter, int threads) {
  if (frf.lines() < 2 * kWindow) return true;
  if (median_ratio(scatter.variance, frf.response.cwiseAbs2()) > kMostOfResponse) return true;
  const auto others = Eigen::seq(0, frf.lines() - 1, 2);
  const Eigen::MatrixXd of_half =
      scatter_variance(frf.frequency_hz(others), frf.response(Eigen::all, others), threads);
  return median_ratio(of_half, scatter.variance(Eigen::all, others)) > kMostByDistance;
}

}  // namespace stageid
