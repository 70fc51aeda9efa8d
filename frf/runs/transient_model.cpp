// Symbols: l a line, b = P l its bin, r = (bin - b) / (half the window's width). T has the regressors
// 1, r, ..., r^5.
#include "frf/runs/transient_model.hpp"

#include <algorithm>
#include <cmath>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/statistics/local_fit.hpp"

namespace stageid {
namespace {

// With one period the window has 30 lines: order 2 and two poles left a remainder of the transient of
// 1.5 times the noise, and tens of times next to a mode (docs/theory.md, section 4).
constexpr Eigen::Index kOrder = 5;
constexpr int kMostPoles = 4;
// A pole fitted to noise removes more of the residual than its degree of freedom, because it was selected.
constexpr double kChanceOfAPole = 0.005;
// Degrees of freedom left by the polynomials: more give a better noise estimate per run, fewer a narrower window,
// within which the polynomials are accurate. An even number of bins: as many below as above.
constexpr Eigen::Index kResidualDof = 10;
constexpr int kDof = 9;  // those of the scatter, whose bins have unequal weights: 9.5 to 9.7

/// Adds weight e e^H, packed as in RunSpectra, for each column e.
void add_scatter(double weight, const Eigen::MatrixXcd& columns, Eigen::Index k, RunSpectra& run) {
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    add_outer_product(weight, columns.col(c).real(), columns.col(c).imag(),
                      run.scatter_re.col(k).data(), run.scatter_im.col(k).data());
  }
}

}  // namespace

TransientModel::TransientModel(int period_samples, int periods,
                               const ExcitationSpectrum& excitation, Eigen::Index outputs,
                               const std::string& place)
    : periods_(periods),
      bins_((static_cast<Eigen::Index>(period_samples) * periods + 1) / 2),
      excitation_(excitation),
      outputs_(outputs) {
  std::vector<char> taken(bins_, 0);
  taken[0] = 1;  // an offset, not a transient
  if (periods > 1) {
    // All lines, excited or not, because they contain distortions of the plant.
    for (Eigen::Index b = 0; b < bins_; b += periods) taken[b] = 1;
  } else {
    for (const int line : excitation.lines) taken[line] = 1;
  }
  const auto first = taken.begin() + static_cast<Eigen::Index>(excitation.lines.front());
  const auto last = taken.begin() + static_cast<Eigen::Index>(excitation.lines.back());
  if (periods == 1 && 2 * std::count(first, last, char{0}) + 1 < std::ssize(excitation.lines))
    fail_request(
        "{}: with a single period, method 'lpm' estimates the transient from unexcited "
        "lines, but there are too few. Excite only odd lines, or measure two periods",
        place);
  for (Eigen::Index b = 0; b < bins_; ++b) {
    if (taken[b] == 0) usable_.push_back(b);
  }
  window_ = kOrder + 1 + kResidualDof;
  if (std::ssize(usable_) < window_)
    fail_request(
        "{}: method 'lpm' needs {} bins between the lines, but this record of {} has "
        "{}; measure more periods",
        place, window_, counted(periods, "period"), usable_.size());
}

Eigen::Index TransientModel::first_of_window(Eigen::Index bin) const {
  const auto above = std::ranges::lower_bound(usable_, bin) - usable_.begin();
  return std::clamp<Eigen::Index>(above - window_ / 2, 0, std::ssize(usable_) - window_);
}

void TransientModel::separate_line(const Eigen::MatrixXcd& Z, Eigen::Index k,
                                   RunSpectra& run) const {
  const Eigen::Index bin = Eigen::Index{periods_} * excitation_.lines[k];
  const auto first = usable_.begin() + first_of_window(bin);
  const std::vector<Eigen::Index> bins(first, first + window_);
  const double reach =
      static_cast<double>(std::max(std::abs(bins.front() - bin), std::abs(bins.back() - bin)));
  LocalProblem problem;
  problem.Z = Z(Eigen::all, bins);
  problem.r.resize(window_);
  problem.groups = {window_};
  problem.independent_noise = outputs_;
  problem.pole_channels = outputs_;  // the inputs repeat their noise
  problem.tested_noise = outputs_;
  problem.chance_of_a_pole = kChanceOfAPole;
  for (Eigen::Index i = 0; i < window_; ++i)
    problem.r[i] = static_cast<double>(bins[i] - bin) / reach;
  set_polynomials(problem, kOrder);

  const LocalFit fit = fit_locally(problem, kMostPoles);
  run.scatter_first[k] = first - usable_.begin();
  run.mean.col(k) = Z.col(bin) - fit.value.col(0);
  run.line_dof[k] = static_cast<double>(kDof) * fit.dof / static_cast<double>(kResidualDof);
  // Scaled for single periods. The line's own noise is the mean of the bins'; that of T is the sum of |weight|^2 times
  // the bin's own, because the loop colours the noise. For white noise the sum is (1 + leverage) times the noise,
  // with the degrees of freedom fit.dof.
  const double periods = periods_ * static_cast<double>(kDof);
  const double shared = static_cast<double>(kResidualDof) / fit.dof;  // used by poles
  const Eigen::ArrayXd weight =
      1.0 / fit.dof + shared * fit.weight.array().abs2() / fit.freedom.array();
  add_scatter(periods, fit.residual * weight.sqrt().matrix().asDiagonal(), k, run);
  if (fit.poles > 0) add_scatter(periods, fit.pole_spread, k, run);
}

void TransientModel::separate(const Eigen::MatrixXcd& Z, RunSpectra& run) const {
  const auto lines = std::ssize(excitation_.lines);
  const Eigen::Index n = Z.rows();
  run.mean.resize(n, lines);
  run.scatter_re.setZero(n * (n + 1) / 2, lines);
  run.scatter_im.setZero(n * (n + 1) / 2, lines);
  run.scatter_dof = kDof;
  run.line_dof.resize(lines);
  run.scatter_window = window_;
  run.scatter_first.resize(excitation_.lines.size());
  for (Eigen::Index k = 0; k < lines; ++k) separate_line(Z, k, run);
}

}  // namespace stageid
