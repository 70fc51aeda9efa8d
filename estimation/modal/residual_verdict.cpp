#include "estimation/modal/residual_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "frf/response/neighbour_scatter.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

// times the variance: the error of the model is then as large as the noise
constexpr double kAllowed = 2.0;
constexpr double kByChance = 1e-3;   // probability that any part of a right model is not explained
constexpr Eigen::Index kRun = 32;    // lines judged together
constexpr double kRounding = 1e-20;  // of the power of a line: no measurement is more exact

/// Sums over one part of the data.
struct Part {
  std::string place;
  double t = 0.0;
  double r = 0.0;
  double entries = 0.0;
  double lines = 0.0;  ///< with at least one entry

  void add(double t_of_entry, double r_of_entry) {
    t += t_of_entry;
    r += r_of_entry;
    entries += 1.0;
  }
  double mean_t() const { return entries > 0.0 ? t / entries : 0.0; }
  double mean_r() const { return entries > 0.0 ? r / entries : 0.0; }
};

/// The parts of the data, judged by one variance.
class Parts {
 public:
  Parts(const FrfEstimate& frf, double dof) : frf_(frf), dof_(dof) {
    parts_.push_back({});
    for (const std::string& name : frf.outputs.names) parts_.push_back({"output " + name});
    for (const std::string& name : frf.inputs.names) parts_.push_back({"input " + name});
    for (Eigen::Index first = 0; first < frf.lines(); first += kRun) {
      const Eigen::Index last = std::min(first + kRun, frf.lines()) - 1;
      parts_.push_back(
          {fmt::format("{:.4g} to {:.4g} Hz", frf.frequency_hz[first], frf.frequency_hz[last])});
    }
    seen_.resize(parts_.size());
  }

  /// Adds one line: its residual, variance and weights (empty: all count), n_c each.
  void add_line(Eigen::Index k, const Eigen::Ref<const Eigen::VectorXcd>& residual,
                const Eigen::Ref<const Eigen::VectorXd>& variance,
                const Eigen::Ref<const Eigen::VectorXd>& weights) {
    const Eigen::Index n_y = frf_.n_outputs();
    const double rounding = kRounding * frf_.response.col(k).squaredNorm();
    std::fill(seen_.begin(), seen_.end(), false);
    for (Eigen::Index c = 0; c < residual.size(); ++c) {
      // A variance of zero is unknown.
      if (!(variance[c] > 0.0) || (weights.size() > 0 && !(weights[c] > 0.0))) continue;
      const double r = std::norm(residual[c]) / (variance[c] + rounding);
      const double scaled = r / kAllowed;
      const double t = dof_ > 0.0 ? dof_ * std::log1p(scaled / dof_) : scaled;
      const Eigen::Index outputs = 1;
      const Eigen::Index inputs = outputs + n_y;
      const Eigen::Index runs = inputs + frf_.n_inputs();
      for (const Eigen::Index p :
           {Eigen::Index{0}, outputs + c % n_y, inputs + c / n_y, runs + k / kRun}) {
        parts_[static_cast<std::size_t>(p)].add(t, r);
        seen_[static_cast<std::size_t>(p)] = true;
      }
    }
    for (std::size_t p = 0; p < parts_.size(); ++p) parts_[p].lines += seen_[p] ? 1.0 : 0.0;
  }

  const Part& all() const { return parts_.front(); }

  /// The mean of r if the error is noise; 0: infinite.
  double expected() const { return dof_ > 1.0 ? dof_ / (dof_ - 1.0) : dof_ > 0.0 ? 0.0 : 1.0; }

  /// The unexplained part to report: all data if unexplained, else the worst; null: all parts are explained.
  const Part* unexplained() const {
    if (is_unexplained(all())) return &all();
    const Part* worst = nullptr;
    for (const Part& part : parts_)
      if (is_unexplained(part) && (worst == nullptr || part.mean_t() > worst->mean_t()))
        worst = &part;
    return worst;
  }

  /// "the residual is 177 times what noise explains, most of it at output z1".
  std::string reason(const Part& part, const char* causes) const {
    const Part* worst = &part;
    if (&part == &all())
      for (const Part& other : parts_)
        if (other.mean_t() > worst->mean_t()) worst = &other;
    const char* preposition = worst == &all() ? "" : worst == &part ? " at " : ", most of it at ";
    return fmt::format("the residual is {:.3g} times what {}{}{}", excess(part), causes,
                       preposition, worst->place);
  }

 private:
  /// If r has no mean, the mean of t is used as size of the excess.
  double excess(const Part& part) const {
    return expected() > 0.0 ? part.mean_r() / expected() : kAllowed * part.mean_t();
  }

  bool is_unexplained(const Part& part) const {
    if (!(part.mean_t() > 1.0)) return false;
    if (!std::isfinite(part.mean_t())) return true;
    // The sum of n exponential numbers is half a chi-square variable with 2 n degrees of freedom.
    const double n = std::max(1.0, part.lines / frf_.correlated_lines);
    return tail_of_chi_square(2.0 * n * part.mean_t(), 2.0 * n) *
               static_cast<double>(parts_.size()) <
           kByChance;
  }

  const FrfEstimate& frf_;
  double dof_;
  std::vector<Part> parts_;
  std::vector<bool> seen_;
};

constexpr Eigen::Index kTile = 64;  // lines

/// The variance of lines from `first` on, whose residual is E.
using VarianceOfTile =
    std::function<Eigen::MatrixXd(Eigen::Index first, const Eigen::MatrixXcd& E)>;

/// Judges by one variance, with so many degrees of freedom.
ResidualVerdict judge_by(const FrfEstimate& frf, const ModelLinesResponse& model,
                         const Eigen::MatrixXd& weights, ResidualVariance kind, double dof,
                         const VarianceOfTile& variance_of, const char* causes) {
  ResidualVerdict verdict;
  verdict.variance = kind;
  verdict.dof = dof;
  Parts parts(frf, dof);
  const Eigen::MatrixXd none(0, 1);
  for (Eigen::Index first = 0, count = 0; first < frf.lines(); first += count) {
    count = frf.lines() - first;
    if (count >= 2 * kTile) count = kTile;  // the last tile has enough lines for a scatter
    const Eigen::MatrixXcd E = frf.response.middleCols(first, count) - model(first, count);
    const Eigen::MatrixXd variance = variance_of(first, E);
    for (Eigen::Index i = 0; i < count; ++i)
      parts.add_line(first + i, E.col(i), variance.col(i),
                     weights.size() > 0 ? weights.col(first + i) : none.col(0));
  }
  verdict.chi_square = parts.all().mean_r();
  verdict.expected = parts.expected();
  const Part* unexplained = parts.unexplained();
  verdict.explained = unexplained == nullptr;
  verdict.reason = verdict.explained ? "" : parts.reason(*unexplained, causes);
  return verdict;
}

/// For data without variances: their variance is the scatter of the residual from line to line. What a model misses is
/// smooth.
ResidualVerdict judge_by_itself(const FrfEstimate& frf, const ModelLinesResponse& model,
                                const Eigen::MatrixXd& weights, int threads) {
  if (!has_line_scatter(frf.lines())) return {};
  Eigen::MatrixXd scatter(frf.response.rows(), frf.lines());
  ResidualVerdict verdict = judge_by(
      frf, model, weights, ResidualVariance::scatter, kScatterDof,
      [&](Eigen::Index first, const Eigen::MatrixXcd& E) -> Eigen::MatrixXd {
        return scatter.middleCols(first, E.cols()) =
                   scatter_variance(frf.frequency_hz.segment(first, E.cols()), E, threads);
      },
      "neighbouring lines differ by");
  verdict.scatter = std::move(scatter);
  return verdict;
}

}  // namespace

ResidualVerdict judge_residual(const FrfEstimate& frf, const ModelLinesResponse& model,
                               const Eigen::MatrixXd& weights, int threads,
                               const Distortion& known) {
  if (weights.size() > 0 &&
      (weights.rows() != frf.response.rows() || weights.cols() != frf.response.cols()))
    throw std::invalid_argument("residual: the weights must have the shape of the response");
  const auto judge_with = [&](ResidualVariance kind, const Eigen::MatrixXd& variance, double dof) {
    return judge_by(
        frf, model, weights, kind, dof,
        [&](Eigen::Index first, const Eigen::MatrixXcd& E) {
          return Eigen::MatrixXd(variance.middleCols(first, E.cols()));
        },
        kind == ResidualVariance::noise ? "noise explains" : "noise and distortion explain");
  };
  const bool has_noise = frf.noise_variance.size() > 0;
  const bool has_total = frf.total_variance.size() > 0;
  ResidualVerdict verdict;
  if (has_noise) verdict = judge_with(ResidualVariance::noise, frf.noise_variance, frf.noise_dof);
  if (verdict.explained && has_noise) return verdict;
  if (has_total) {
    ResidualVerdict total = judge_with(ResidualVariance::total, frf.total_variance, frf.total_dof);
    return total.explained || !has_noise ? total : verdict;
  }
  if (!has_noise) return judge_by_itself(frf, model, weights, threads);
  if (known.level.cols() > 0 && known.level.rows() == frf.response.rows()) {
    Eigen::MatrixXd variance = variance_with(known, frf);
    ResidualVerdict distorted = judge_with(ResidualVariance::total, variance, frf.noise_dof);
    if (distorted.explained) {
      distorted.scatter = std::move(variance);
      return distorted;
    }
  }
  LineScatter lines = line_scatter(frf, threads);
  if (!lines.shows_distortion() || lines_are_coarse(frf, lines, threads)) return verdict;
  ResidualVerdict scatter = judge_with(ResidualVariance::scatter, lines.variance, lines.dof);
  if (!scatter.explained) return verdict;
  scatter.scatter = std::move(lines.variance);
  return scatter;
}

}  // namespace stageid
