#include "frf/response/neighbour_scatter.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>

#include "excitation/threads/worker_pool.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/statistics/local_fit.hpp"

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

/// The upper median of the nonnegative ratios a / b of all channels with b > 0; 0: there are none. Nonnegative numbers
/// have the same order as their bits, so it is found digit by digit, by counting: no ratio is stored or sent.
/// @param a, b called with channel and line
template <typename A, typename B>
double median_ratio(const FrfEstimate& frf, Eigen::Index lines, const A& a, const B& b) {
  constexpr int kDigit = 16;
  const auto [first, count] = frf.own();
  std::uint64_t found = 0;  // the higher digits
  Eigen::Index rank = 0;
  for (int shift = 64 - kDigit; shift >= 0; shift -= kDigit) {
    Eigen::VectorXd counts = Eigen::VectorXd::Zero(Eigen::Index{1} << kDigit);
    for (Eigen::Index k = 0; k < lines; ++k)
      for (Eigen::Index c = first; c < first + count; ++c) {
        const double below = b(c, k);
        if (!(below > 0.0)) continue;
        const std::uint64_t digits = std::bit_cast<std::uint64_t>(a(c, k) / below) >> shift;
        if (digits >> kDigit == found) counts[digits & 0xffff] += 1.0;
      }
    counts = frf.team->sum(channel_tiles(frf.response.rows()), counts.size(), {counts});
    if (shift + kDigit == 64) rank = static_cast<Eigen::Index>(counts.sum()) / 2;
    Eigen::Index digit = 0;
    while (digit < counts.size() && rank >= static_cast<Eigen::Index>(counts[digit]))
      rank -= static_cast<Eigen::Index>(counts[digit++]);
    if (digit == counts.size()) return 0.0;
    found = found << kDigit | static_cast<std::uint64_t>(digit);
  }
  return std::bit_cast<double>(found);
}

/// scatter_variance() of every `step`-th line, tile by tile: each tile has its poles.
Eigen::MatrixXd scatter_of_tiles(const FrfEstimate& frf, Eigen::Index step, int threads) {
  const auto lines = Eigen::seq(0, frf.lines() - 1, step);
  if (!has_line_scatter(lines.size())) return {};
  Eigen::MatrixXd variance(frf.response.rows(), lines.size());
  for_each_own_tile(*frf.team, variance.rows(), [&](DataRange tile) {
    const auto [first, count] = tile;
    variance.middleRows(first, count) = scatter_variance(
        frf.frequency_hz(lines), frf.response.middleRows(first, count)(Eigen::all, lines), threads);
  });
  return variance;
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
  scatter.variance = scatter_of_tiles(frf, 1, threads);
  if (scatter.variance.size() == 0) return scatter;
  scatter.dof = static_cast<double>(kScatterDof);
  if (frf.noise_variance.size() > 0)
    scatter.over_noise = median_ratio(frf, frf.lines(), scatter.variance, frf.noise_variance);
  return scatter;
}

bool lines_are_coarse(const FrfEstimate& frf, const LineScatter& scatter, int threads) {
  if (frf.lines() < 2 * kWindow) return true;
  const auto power = [&](Eigen::Index c, Eigen::Index k) {
    return Eigen::numext::abs2(frf.response(c, k));
  };
  if (median_ratio(frf, frf.lines(), scatter.variance, power) > kMostOfResponse) return true;
  const Eigen::MatrixXd of_half = scatter_of_tiles(frf, 2, threads);
  const auto of_all = [&](Eigen::Index c, Eigen::Index k) { return scatter.variance(c, 2 * k); };
  return median_ratio(frf, of_half.cols(), of_half, of_all) > kMostByDistance;
}

}  // namespace stageid
