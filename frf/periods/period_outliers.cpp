#include "frf/periods/period_outliers.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>

#include "excitation/multisine/dft.hpp"
#include "frf/periods/octave_record.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/frequency_bands.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Periods = std::vector<Index>;

constexpr double kRounding = 1e-26;  // of the largest line's power: scatter without noise
constexpr Index kFewestPositions = 4;
constexpr double kDropByChance = 1e-3;  // largest probability that a clean run loses a period

/// Noise ratio g at which including one more period leaves the variance of the mean of n periods unchanged.
double worth_dropping(std::size_t n) { return 2.0 + 1.0 / static_cast<double>(n); }

/// Ratio of two sums of squares: p's deviation from the mean of the core, and the scatter of the core. Each is
/// divided by its expectation for the noise of one period. `gram`: Re d_p^H d_q.
double power_ratio(const Eigen::MatrixXd& gram, const Periods& core, Index p) {
  const auto n = static_cast<double>(core.size());
  double own = 0.0;
  double cross = 0.0;
  double all = 0.0;
  for (const Index q : core) {
    own += gram(q, q);
    cross += gram(p, q);
    for (const Index r : core) all += gram(q, r);
  }
  const double mean = all / (n * n);
  const double deviation = (gram(p, p) - 2.0 * cross / n + mean) * n / (n + 1.0);
  const double scatter = (own - n * mean) / (n - 1.0);
  return scatter > 0.0 ? deviation / scatter : 0.0;
}

/// For one channel, one matrix per band: Re sum over its lines of conj(d_p) d_q. d is the deviation from the mean
/// over the root of the line's scatter.
std::vector<Eigen::MatrixXd> line_grams(const ComparedPeriods& periods, Index channel,
                                        const std::vector<IndexRange>& bands) {
  const auto P = std::ssize(periods.spectra);
  const double smallest =
      kRounding *
      periods.spectra.front().row(channel).head(periods.frequency_hz.size()).cwiseAbs2().maxCoeff();
  std::vector<Eigen::MatrixXd> grams;
  Eigen::MatrixXcd deviation;
  for (const IndexRange& band : bands) {
    const Index lines = band.count();
    deviation.resize(lines, P);
    for (Index p = 0; p < P; ++p)
      deviation.col(p) = periods.spectra[p].row(channel).segment(band.first, lines).transpose();
    const Eigen::VectorXcd mean = deviation.rowwise().mean();
    deviation.colwise() -= mean;
    for (Index k = 0; k < lines; ++k) {
      const double scatter = deviation.row(k).squaredNorm();
      deviation.row(k) *= scatter > smallest ? 1.0 / std::sqrt(scatter) : 0.0;
    }
    Eigen::MatrixXd gram = (deviation.adjoint() * deviation).real();
    if (gram.trace() > 0.0) grams.push_back(std::move(gram));
  }
  return grams;
}

double mean_ratio(const std::vector<Eigen::MatrixXd>& grams, const Periods& core, Index p) {
  double sum = 0.0;
  for (const Eigen::MatrixXd& gram : grams) sum += power_ratio(gram, core, p);
  return sum / static_cast<double>(grams.size());
}

/// The smallest neighbourhood with more than half of the periods.
Periods closest_periods(const std::vector<Eigen::MatrixXd>& grams) {
  const Index P = grams.front().rows();
  Eigen::MatrixXd distance = Eigen::MatrixXd::Zero(P, P);
  for (const Eigen::MatrixXd& gram : grams) {
    const Eigen::MatrixXd apart = gram.diagonal().rowwise().replicate(P) +
                                  gram.diagonal().transpose().colwise().replicate(P) - 2.0 * gram;
    std::vector<double> pairs;
    for (Index p = 0; p < P; ++p)
      for (Index q = 0; q < p; ++q) pairs.push_back(apart(p, q));
    const double usual = median(pairs);
    if (usual > 0.0) distance += apart / usual;
  }
  const auto rank = static_cast<std::size_t>(P / 2);  // the period itself has rank 0
  Index centre = 0;
  double nearest = std::numeric_limits<double>::infinity();
  for (Index p = 0; p < P; ++p) {
    std::vector<double> to(distance.col(p).begin(), distance.col(p).end());
    const double reach = value_of_rank(to, rank);
    if (reach >= nearest) continue;
    nearest = reach;
    centre = p;
  }
  Periods order(static_cast<std::size_t>(P));
  std::iota(order.begin(), order.end(), Index{0});
  std::ranges::sort(order, [&](Index p, Index q) {
    return p != centre && q != centre ? distance(p, centre) < distance(q, centre)
                                      : p == centre && q != centre;
  });
  order.resize(rank + 1);
  return order;
}

/// The periods that reduce the variance of the mean.
Periods core_of(const std::vector<Eigen::MatrixXd>& grams) {
  Periods core = closest_periods(grams);
  while (std::ssize(core) < grams.front().rows()) {
    Index next = -1;
    double least = worth_dropping(core.size());
    for (Index p = 0; p < grams.front().rows(); ++p) {
      if (std::ranges::find(core, p) != core.end()) continue;
      const double ratio = mean_ratio(grams, core, p);
      if (ratio > least) continue;
      least = ratio;
      next = p;
    }
    if (next < 0) break;
    core.push_back(next);
  }
  std::ranges::sort(core);
  return core;
}

/// Positions at which all coefficients of p exist and those of the core depend on the core alone.
Periods comparable_positions(const OctaveRecord& octave, const Periods& core, Index p) {
  Eigen::Array<bool, Eigen::Dynamic, 1> in =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(octave.detail.cols(), false);
  for (const Index q : core) in[q] = true;
  Periods positions;
  for (Index i = 0; i < octave.detail.rows(); ++i) {
    const Index before = octave.first_period(i);
    const Index after = octave.last_period(i);
    const bool all = std::isfinite(octave.detail(i, p)) && std::ranges::all_of(core, [&](Index q) {
                       return std::isfinite(octave.detail(i, q)) &&
                              in.segment(q + before, after - before + 1).all();
                     });
    if (all) positions.push_back(i);
  }
  return positions;
}

struct DegreesOfFreedom {
  double period = 0.0;  ///< real, of one period
  double core = 0.0;    ///< real, of the whole core
};

/// From the periodogram of the core's residuals, each period in its place and zeros between. Noise correlated
/// over several periods has few. Half of each is used, because a sine between two lines contributes to both.
DegreesOfFreedom degrees_of_freedom(const Eigen::MatrixXd& residuals, const Periods& core,
                                    std::span<const int> number) {
  const auto place = [&](Index p) { return Index{number[p]}; };
  const Index span = place(core.back()) - place(core.front()) + 1;
  RealDft dft(static_cast<int>(residuals.rows() * span));
  std::fill(dft.input().begin(), dft.input().end(), 0.0);
  for (std::size_t q = 0; q < core.size(); ++q)
    std::copy_n(residuals.col(q).data(), residuals.rows(),
                dft.input().begin() + (place(core[q]) - place(core.front())) * residuals.rows());
  const auto transformed = dft.forward();
  double sum = 0.0;
  double squares = 0.0;
  double smooth_squares = 0.0;
  double smooth = 0.0;
  for (std::size_t k = 1; k < transformed.size(); ++k) {
    const double power = std::norm(transformed[k]);
    sum += power;
    squares += power * power;
    smooth += power;
    if (static_cast<Index>(k) % span != 0 && k + 1 < transformed.size()) continue;
    smooth_squares += smooth * smooth;
    smooth = 0.0;
  }
  if (!(sum > 0.0)) return {};
  const auto most = static_cast<double>(residuals.rows());
  return {std::min(sum * sum / smooth_squares, most),
          std::min(sum * sum / squares, most * static_cast<double>(residuals.cols() - 1))};
}

double log_tail(double ratio, const DegreesOfFreedom& dof) {
  const int a = static_cast<int>(0.5 * dof.period);
  return a < 1 ? 0.0 : log_tail_of_f(ratio, a, 0.5 * dof.core);
}

struct Excess {
  double ratio = 0.0;  ///< power of the period over that of the core
  double power = 0.0;  ///< of the period's deviation
  IndexRange where;    ///< the coefficients that cannot be noise
};

/// The samples of the coefficients whose square has a probability below `log_chance` as that of normal noise.
IndexRange deviating_samples(const OctaveRecord& octave, const Periods& positions,
                             const Eigen::VectorXd& deviation, double variance, double log_chance) {
  const double least = -2.0 * (log_chance - std::log(static_cast<double>(positions.size())));
  IndexRange range;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const double here = deviation[i];
    if (!(here * here > least * variance)) continue;
    // Coefficients beyond an end of the period are not compared: a deviation of the last one may go on.
    const Index first = octave.begin + positions[i] * octave.step;
    range.include({i == 0 ? 0 : first, i + 1 == positions.size()
                                           ? octave.detail.rows() * octave.step
                                           : first + octave.length});
  }
  return range;
}

/// Of p in one octave, if it is significant.
std::optional<Excess> excess(const OctaveRecord& octave, std::span<const int> number,
                             const Periods& core, Index p, double log_chance) {
  const Periods positions = comparable_positions(octave, core, p);
  const auto M = std::ssize(positions);
  if (M < kFewestPositions) return std::nullopt;
  const auto n = std::ssize(core);
  Eigen::MatrixXd residuals = octave.detail(positions, core);
  const Eigen::VectorXd mean = residuals.rowwise().mean();
  residuals.colwise() -= mean;
  const Eigen::VectorXd own = octave.detail(positions, p);
  const double deviation =
      (own - mean).squaredNorm() * static_cast<double>(n) / static_cast<double>(n + 1);
  const double scatter = residuals.squaredNorm() / static_cast<double>(n - 1);
  if (!(scatter > 0.0)) return std::nullopt;
  const double ratio = deviation / scatter;
  const DegreesOfFreedom most{static_cast<double>(M), static_cast<double>(M * (n - 1))};
  if (!(ratio > 1.0 && log_tail(ratio, most) < log_chance)) return std::nullopt;
  DegreesOfFreedom dof = degrees_of_freedom(residuals, core, number);
  // A core selected for similarity may lack the narrow noise that p has.
  const double alone = degrees_of_freedom(own - mean, {p}, number).period;
  dof = {std::min(dof.period, alone), std::min(dof.core, alone * static_cast<double>(n - 1))};
  if (!(log_tail(ratio, dof) < log_chance)) return std::nullopt;
  const double variance = scatter * static_cast<double>(n + 1) / static_cast<double>(n * M);
  // The coefficients of an octave have the density of the power in it.
  return Excess{ratio, deviation / static_cast<double>(M) * (octave.high_hz - octave.low_hz),
                deviating_samples(octave, positions, own - mean, variance, log_chance)};
}

/// The record of one channel, samples x periods.
Eigen::MatrixXd record_of(const ComparedPeriods& periods, Index channel) {
  Eigen::MatrixXd record(periods.samples.front().rows(), std::ssize(periods.spectra));
  for (Index p = 0; p < record.cols(); ++p)
    record.col(p) = periods.samples[p].col(channel).cast<double>();
  return record;
}

/// ln of the number of ways to choose a core of n periods and one more, because this core was selected for
/// similarity.
double log_choices(Index P, std::size_t n) {
  const auto in = static_cast<double>(n);
  const auto all = static_cast<double>(P);
  return log_gamma(all + 1.0) - log_gamma(in + 1.0) - log_gamma(all - in + 1.0) +
         std::log(all - in);
}

struct Candidate {
  PeriodOutlier outlier;
  double gain = 0.0;
};

/// Outlier candidates of one channel.
std::vector<Candidate> candidates(const ComparedPeriods& periods, Index channel,
                                  const std::vector<IndexRange>& bands) {
  const std::vector<Eigen::MatrixXd> grams = line_grams(periods, channel, bands);
  if (grams.empty()) return {};
  const Periods core = core_of(grams);
  const auto P = std::ssize(periods.spectra);
  std::vector<Candidate> found;
  if (std::ssize(core) == P) return found;
  std::vector<OctaveRecord> octaves = octave_records(
      record_of(periods, channel), periods.number, periods.sample_rate_hz, periods.frequency_hz[0]);
  std::erase_if(octaves, [&](const OctaveRecord& octave) {
    return octave.low_hz > periods.frequency_hz[periods.frequency_hz.size() - 1];
  });
  const double log_tests =
      log_choices(P, core.size()) + std::log(static_cast<double>(periods.spectra.front().rows()) *
                                             static_cast<double>(octaves.size()));
  for (Index p = 0; p < P; ++p) {
    if (std::ranges::binary_search(core, p)) continue;
    Candidate most;
    most.gain = mean_ratio(grams, core, p);
    double power = 0.0;
    IndexRange where;
    for (const OctaveRecord& octave : octaves) {
      const std::optional<Excess> here =
          excess(octave, periods.number, core, p, std::log(kDropByChance) - log_tests);
      if (!here) continue;
      if (power == 0.0) where = here->where;  // the highest octave
      if (!(here->power > power)) continue;
      power = here->power;
      most.outlier = {
          static_cast<std::size_t>(p), channel, octave.low_hz, octave.high_hz, here->ratio, where};
    }
    if (most.outlier.ratio > 0.0) found.push_back(most);
  }
  return found;
}

}  // namespace

PeriodOutliers find_outliers(const ComparedPeriods& periods) {
  PeriodOutliers result;
  const std::size_t P = periods.spectra.size();
  if (P < 3) return result;
  const std::vector<IndexRange> bands = octave_bands(periods.frequency_hz);
  std::vector<Candidate> most(P);  // of each period
  for (Index c = 0; c < periods.spectra.front().rows(); ++c)
    for (const Candidate& candidate : candidates(periods, c, bands)) {
      Candidate& of_period = most[candidate.outlier.period];
      IndexRange where = of_period.outlier.where;
      where.include(candidate.outlier.where);
      if (candidate.gain > of_period.gain) of_period = candidate;
      of_period.outlier.where = where;
    }
  for (std::size_t p = 0; p < P; ++p)
    if (most[p].gain == 0.0) result.consistent.push_back(p);
  std::erase_if(most, [](const Candidate& candidate) { return candidate.gain == 0.0; });
  std::ranges::sort(most, std::ranges::greater(), &Candidate::gain);
  most.resize(std::min(most.size(), (P - 1) / 2));
  for (const Candidate& candidate : most) result.found.push_back(candidate.outlier);
  std::ranges::sort(result.found, {}, &PeriodOutlier::period);
  return result;
}

}  // namespace stageid
