#include "estimation/tracking/model_tracker.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <deque>
#include <functional>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "estimation/tracking/change_detector.hpp"
#include "estimation/tracking/forgetting_filter.hpp"
#include "estimation/tracking/line_noise.hpp"
#include "estimation/tracking/tracked_response.hpp"

namespace stageid {
namespace {

PeriodSpectra mean_of(const std::deque<PeriodSpectra>& periods, std::size_t last) {
  PeriodSpectra mean = periods.back();
  for (std::size_t i = periods.size() - last; i + 1 < periods.size(); ++i) {
    mean.Y += periods[i].Y;
    mean.U += periods[i].U;
  }
  mean.Y /= static_cast<double>(last);
  mean.U /= static_cast<double>(last);
  return mean;
}

/// Periods that are kept to name a change. One that needs more periods is small: its linear effect is sufficient.
constexpr std::size_t kKept = 32;
/// Least number of periods after the one of the change, for its name.
constexpr int kToName = 2;

/// What a slow motion over the ends of a period leaves on the lines of an output: the spectra of a linear and of a
/// quadratic trend, n_y N x 2 n_y.
Eigen::MatrixXcd trends(const Eigen::VectorXd& frequency_hz, double sample_rate_hz,
                        Eigen::Index n_y) {
  const Eigen::Index N = frequency_hz.size();
  Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(n_y * N, 2 * n_y);
  for (Eigen::Index k = 0; k < N; ++k) {
    const std::complex<double> sum =
        1.0 / (1.0 - std::polar(1.0, -2.0 * std::numbers::pi * frequency_hz[k] / sample_rate_hz));
    for (Eigen::Index i = 0; i < n_y; ++i) {
      out(k * n_y + i, i) = sum;
      out(k * n_y + i, n_y + i) = sum * sum;
    }
  }
  return out;
}

/// Prior information of the tracked parameters. A common factor of all sensors and its inverse of all actuators cannot
/// be distinguished: it is held at one.
Eigen::MatrixXd prior_information(const TrackedResponse& response) {
  const Eigen::VectorXd changes =
      largest_changes(response.parameters(), response.model().sample_rate_hz);
  Eigen::MatrixXd prior = changes.array().square().inverse().matrix().asDiagonal();
  Eigen::VectorXd common = Eigen::VectorXd::Zero(response.size());
  for (Eigen::Index p = 0; p < common.size(); ++p) {
    const TrackedKind kind = response.parameters()[static_cast<std::size_t>(p)].kind;
    if (kind == TrackedKind::sensor_gain) common[p] = 1.0;
    if (kind == TrackedKind::actuator_gain) common[p] = -1.0;
  }
  constexpr double kHeld = 1e12;  // a deviation of 1e-6
  return prior + kHeld / common.squaredNorm() * common * common.transpose();
}

/// All changes that the information of the learned periods can show: those of a size that a stage may have exceed
/// their standard deviation.
std::vector<PossibleChange> possible_changes(const TrackedResponse& response,
                                             const Eigen::MatrixXd& information) {
  const Eigen::VectorXd largest =
      largest_changes(response.parameters(), response.model().sample_rate_hz);
  std::vector<PossibleChange> changes;
  const Eigen::Index q = response.size();
  Eigen::VectorXd frequencies = Eigen::VectorXd::Zero(q);
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(q);
  for (Eigen::Index p = 0; p < q; ++p) {
    if (information(p, p) * largest[p] * largest[p] < 1.0) continue;
    changes.push_back({ChangeKind::parameter, p, Eigen::VectorXd::Unit(q, p)});
    const TrackedKind kind = response.parameters()[static_cast<std::size_t>(p)].kind;
    if (kind == TrackedKind::frequency) frequencies[p] = 1.0;
    if (kind == TrackedKind::sensor_gain) gains[p] = 1.0;
  }
  if (frequencies.sum() > 1.0) changes.push_back({ChangeKind::all_frequencies, 0, frequencies});
  if (gains.sum() > 1.0) changes.push_back({ChangeKind::all_gains, 0, gains});
  for (Eigen::Index i = 0; i < response.model().n_outputs(); ++i)
    changes.push_back({ChangeKind::noise, i, {}});
  return changes;
}

}  // namespace

struct ModelTracker::State {
  State(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
        const TrackerOptions& wanted)
      : options(wanted),
        response(
            model,
            tracked_parameters(model, {frequency_hz[0], frequency_hz[frequency_hz.size() - 1]}),
            frequency_hz),
        filter(prior_information(response), std::exp(-1.0 / wanted.memory_periods)),
        trend(trends(frequency_hz, model.sample_rate_hz, model.n_outputs())) {}

  TrackerOptions options;
  TrackedResponse response;
  ForgettingFilter filter;
  Eigen::MatrixXcd trend;
  std::deque<PeriodSpectra> periods;  // while learning: all of it; else the last ones
  bool learned = false;
  std::optional<Eigen::VectorXd>
      start;  // of the next learning, if the estimate is not to be continued

  // What was learned.
  std::optional<LineNoise> noise;
  std::optional<ChangeDetector> detector;
  std::vector<PossibleChange> possible;
  Eigen::VectorXd x;   // reference
  Eigen::MatrixXcd P;  // there
  Eigen::MatrixXd white_trend;
  Eigen::MatrixXd trend_basis;  // orthonormal
  Eigen::MatrixXd J;            // whitened derivatives there
  Eigen::MatrixXd A;            // information of a period
  Eigen::MatrixXd K;            // covariance of J^T e
  Eigen::MatrixXcd residual;    // constant part
  Eigen::VectorXd gradient;     // J^T of it
  Eigen::VectorXd noise_deviation;
  ReferenceQuality quality;
  std::optional<Eigen::MatrixXcd> last_residual;
  int onset = 0;  // periods since a change that has no name yet

  Eigen::VectorXd whitened(const Eigen::MatrixXcd& residual_) const {
    return noise->whitened(residual_.reshaped());
  }
  Eigen::MatrixXcd residual_of(const PeriodSpectra& period, const Eigen::MatrixXcd& P_) const {
    return period.Y - TrackedResponse::outputs(P_, period.U);
  }
  /// Removes the trends from a residual.
  void remove_trends(Eigen::MatrixXcd& of) const {
    const Eigen::VectorXd size = white_trend.householderQr().solve(whitened(of));
    of.reshaped() -= trend * size;
  }

  void linearize(const Eigen::MatrixXcd& U) {
    J = noise->whitened(response.derivatives(x, U));
    J -= trend_basis * (trend_basis.transpose() * J);
    A = J.transpose() * J;
  }

  /// Gauss-Newton from x to the mean of the learned periods.
  void settle(const PeriodSpectra& mean) {
    const Eigen::MatrixXd prior = prior_information(response);
    const auto n = static_cast<double>(options.learning_periods);
    const auto cost = [&](const Eigen::VectorXd& at) {
      return n * whitened(residual_of(mean, response.at(at))).squaredNorm() + at.dot(prior * at);
    };
    double now = cost(x);
    for (int iteration = 0; iteration < 20; ++iteration) {
      linearize(mean.U);
      const Eigen::VectorXd step =
          Eigen::LDLT<Eigen::MatrixXd>(n * A + prior)
              .solve(n * (J.transpose() * whitened(residual_of(mean, response.at(x)))) - prior * x);
      double length = 1.0;
      double next = cost(x + step);
      while (!(next < now) && length > 1e-3) {
        length *= 0.5;
        next = cost(x + length * step);
      }
      if (!(next < now)) break;
      x += length * step;
      const bool small = now - next < 1e-3;  // of a chi-square
      now = next;
      if (small) break;
    }
  }

  /// The noise and the trends, from residuals at P without trends.
  std::vector<Eigen::MatrixXcd> learn_noise() {
    std::vector<Eigen::MatrixXcd> residuals;
    for (const PeriodSpectra& period : periods) residuals.push_back(residual_of(period, P));
    noise.emplace(residuals);
    // The noise on top of the trends gives the weights to remove them.
    for (int pass = 0; pass < 2; ++pass) {
      white_trend = noise->whitened(trend);
      for (Eigen::MatrixXcd& r : residuals) remove_trends(r);
      noise.emplace(residuals);
    }
    white_trend = noise->whitened(trend);
    trend_basis = white_trend.householderQr().householderQ() *
                  Eigen::MatrixXd::Identity(white_trend.rows(), white_trend.cols());
    return residuals;
  }

  void learn() {
    const auto n = static_cast<double>(periods.size());
    const PeriodSpectra mean = mean_of(periods, periods.size());
    x = start.value_or(filter.estimate());
    P = response.at(x);
    std::vector<Eigen::MatrixXcd> residuals = learn_noise();
    if (start) {
      settle(mean);
      filter.forget();
      start.reset();
      P = response.at(x);
      residuals = learn_noise();  // with feedback, it depends on P
    }
    linearize(mean.U);
    const SumCovariance sums = noise->covariance(J);
    // An estimate over a deviation from nu degrees of freedom has the mean square nu / (nu - 2).
    const Eigen::ArrayXd wider =
        (sums.freedom.array() / (sums.freedom.array() - 2.0).max(1.0)).sqrt();
    K = wider.matrix().asDiagonal() * sums.value * wider.matrix().asDiagonal();
    residual = residual_of(mean, P);
    remove_trends(residual);
    const Eigen::VectorXd white = whitened(residual);
    gradient = J.transpose() * white;
    filter.add(A, K, n * (gradient - A * (filter.estimate() - x)), static_cast<int>(n));
    learn_noise_power(residuals);
    judge_reference(mean, white, n);
    possible = possible_changes(response, n * A);
    detector.emplace(score_correlation(), score_freedom(sums.freedom),
                     options.false_alarms_per_period, static_cast<int>(n));
    periods.clear();
    last_residual.reset();
    onset = 0;
    learned = true;
  }

  /// Standard deviation of the noise power of a sensor, from successive differences.
  void learn_noise_power(const std::vector<Eigen::MatrixXcd>& residuals) {
    Eigen::ArrayXXd power(residual.rows(), std::ssize(residuals) - 1);
    for (Eigen::Index t = 0; t < power.cols(); ++t)
      power.col(t) = noise->relative_power(residuals[static_cast<std::size_t>(t + 1)] -
                                           residuals[static_cast<std::size_t>(t)]);
    const Eigen::ArrayXd mean = power.rowwise().mean();
    const Eigen::ArrayXd scatter = (power.colwise() - mean).square().rowwise().mean();
    // At least that of independent lines; 1.5 times over many periods, because neighbours share one.
    noise_deviation = (1.5 * scatter.max(1.0 / static_cast<double>(residual.cols()))).sqrt();
  }

  void judge_reference(const PeriodSpectra& mean, const Eigen::VectorXd& white, double n) {
    const Eigen::Index n_y = residual.rows();
    const Eigen::MatrixXd squares = white.cwiseAbs2().reshaped(n_y, white.size() / n_y);
    quality.chi_square = n * squares.rowwise().mean();
    const Eigen::ArrayXd excess = residual.rowwise().squaredNorm().array() *
                                  (1.0 - 1.0 / quality.chi_square.array().max(1.0));
    quality.relative_error = (excess / mean.Y.rowwise().squaredNorm().array()).sqrt();
  }

  Eigen::MatrixXd score_correlation() const {
    const auto H = std::ssize(possible);
    Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(H, H);
    for (Eigen::Index g = 0; g < H; ++g)
      for (Eigen::Index h = 0; h < H; ++h) {
        const Eigen::VectorXd& a = direction(g);
        const Eigen::VectorXd& b = direction(h);
        if (a.size() > 0 && b.size() > 0)
          correlation(g, h) = a.dot(K * b) / std::sqrt(a.dot(K * a) * b.dot(K * b));
      }
    return correlation;
  }
  Eigen::VectorXd score_freedom(const Eigen::VectorXd& of_parameters) const {
    Eigen::VectorXd freedom(std::ssize(possible));
    for (Eigen::Index h = 0; h < freedom.size(); ++h)
      freedom[h] = direction(h).size() > 0
                       ? (direction(h).array() != 0.0).select(of_parameters, HUGE_VAL).minCoeff()
                       : static_cast<double>(options.learning_periods - 1);
    return freedom;
  }
  const Eigen::VectorXd& direction(Eigen::Index h) const {
    return possible[static_cast<std::size_t>(h)].direction;
  }

  Eigen::VectorXd scores(const Eigen::VectorXd& shift, const Eigen::VectorXd& power) const {
    Eigen::VectorXd out(std::ssize(possible));
    for (Eigen::Index h = 0; h < out.size(); ++h) {
      const PossibleChange& change = possible[static_cast<std::size_t>(h)];
      if (change.kind == ChangeKind::noise)
        out[h] =
            power.size() == 0 ? 0.0 : (power[change.index] - 1.0) / noise_deviation[change.index];
      else
        out[h] =
            change.direction.dot(shift) / std::sqrt(change.direction.dot(K * change.direction));
    }
    return out;
  }

  struct Explanation;
  Explanation explain(const PossibleChange& change, const PeriodSpectra& mean,
                      double linear_size) const;
  double median_inflation() const {
    std::vector<double> ratios;
    for (const PossibleChange& change : possible)
      if (const Eigen::VectorXd& d = change.direction; d.size() > 0)
        ratios.push_back(d.dot(K * d) / d.dot(A * d));
    std::ranges::sort(ratios);
    return ratios.empty() ? 1.0 : ratios[ratios.size() / 2];
  }
  /// Least damping ratio of the modes whose frequency moves; infinite if none does.
  double narrowest(const PossibleChange& change) const {
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index p = 0; p < response.size(); ++p) {
      const TrackedParameter& of = response.parameters()[static_cast<std::size_t>(p)];
      if (of.kind != TrackedKind::frequency || change.direction[p] == 0.0) continue;
      const Submodel& mode = response.model().submodels[static_cast<std::size_t>(of.index)];
      least = std::min(least, mode.damping_ratio());
    }
    return least;
  }
  bool is_gain(const PossibleChange& change) const {
    const TrackedKind kind = response.parameters()[static_cast<std::size_t>(change.index)].kind;
    return change.kind == ChangeKind::all_gains ||
           (change.kind == ChangeKind::parameter &&
            (kind == TrackedKind::sensor_gain || kind == TrackedKind::actuator_gain));
  }
  /// Of as many periods, each compared with the mean of the learned ones.
  double independent(int count) const {
    return count / (1.0 + static_cast<double>(count) / options.learning_periods);
  }
  bool keeps(int since) const { return since <= std::ssize(periods); }
  std::vector<StageChange> changes_of_response(int since) const;
  /// @param P_ of the most probable other change: in a wrong response, the noise in U raises that of the residual
  std::vector<StageChange> changes_of_noise(int since, const Eigen::MatrixXcd& P_) const;
  /// The most probable change of the last periods, after the one that contains the transient of the change.
  StageChange name(int since) const;
  /// Whitened, without what the trends explain.
  Eigen::VectorXd whitened_change(const Eigen::MatrixXcd& of) const {
    const Eigen::VectorXd white = whitened(of);
    return white - trend_basis * (trend_basis.transpose() * white);
  }
};

/// The size of a change that explains most, and the chi-square that it explains.
struct ModelTracker::State::Explanation {
  double explained = 0.0;
  double size = 0.0;
};

/// A change as large as it is, from the mean of the last periods: the response is not linear in modes and delay, and a
/// large change of the stage also changes the inputs.
ModelTracker::State::Explanation ModelTracker::State::explain(const PossibleChange& change,
                                                              const PeriodSpectra& mean,
                                                              double linear_size) const {
  const TrackedParameter& of = response.parameters()[static_cast<std::size_t>(change.index)];
  const bool one_mode = change.kind == ChangeKind::parameter &&
                        (of.kind == TrackedKind::frequency || of.kind == TrackedKind::damping);
  const auto predicted = [&](double size) {
    const Eigen::VectorXd there = x + size * change.direction;
    return one_mode ? response.at(there, of.index) : response.at(there);
  };
  const Eigen::MatrixXcd before = predicted(0.0);
  const Eigen::VectorXd observed = whitened_change(residual_of(mean, P) - residual);
  const auto left = [&](double size) -> Eigen::VectorXd {
    return observed - whitened_change(TrackedResponse::outputs(predicted(size) - before, mean.U));
  };
  // From the best of some sizes; with the largest, a resonance has left its place. In gains, the response is linear.
  Explanation best{0.0, linear_size};
  double least = left(linear_size).squaredNorm();
  const double largest = largest_changes(response.parameters(), response.model().sample_rate_hz)
                             .cwiseProduct(change.direction)
                             .maxCoeff();
  const auto try_size = [&](double size) {
    const double square = left(size).squaredNorm();
    if (square >= least) return;
    least = square;
    best.size = size;
  };
  for (double size = is_gain(change) ? 0.0 : largest; size > 1e-3 * largest; size *= 0.5)
    for (const double candidate : {size, -size}) try_size(candidate);
  // Resonances are narrow.
  const double step = std::max(narrowest(change), 0.01 * largest);
  for (double size = step; size <= largest; size += step)
    for (const double candidate : {size, -size}) try_size(candidate);
  for (int iteration = 0; iteration < 10; ++iteration) {
    const double difference = 1e-4 * std::abs(best.size) + 1e-12 * largest;
    const Eigen::VectorXd now = left(best.size);
    const Eigen::VectorXd slope = (left(best.size + difference) - now) / difference;
    const double size = best.size - slope.dot(now) / slope.squaredNorm();
    const double square = left(size).squaredNorm();
    if (!(square < least)) break;
    best.size = size;
    least = square;
  }
  best.explained = observed.squaredNorm() - least;
  return best;
}

std::vector<StageChange> ModelTracker::State::changes_of_response(int since) const {
  const Eigen::VectorXd scores_since = detector->mean_scores(since);
  const PeriodSpectra mean =
      mean_of(periods, std::min(periods.size(), static_cast<std::size_t>(since)));
  std::vector<StageChange> changes;
  for (std::size_t h = 0; h < possible.size(); ++h) {
    if (possible[h].kind == ChangeKind::noise) continue;
    StageChange change;
    change.what = possible[h];
    change.periods = since;
    const double score = scores_since[static_cast<Eigen::Index>(h)];
    const Eigen::VectorXd& d = change.what.direction;
    const double information = d.dot(A * d);
    const double scale = std::sqrt(d.dot(K * d)) / information;
    change.size = score * scale;
    change.deviation = scale / std::sqrt(independent(since));
    change.statistic = score * score * independent(since);
    if (!is_gain(change.what) && keeps(since)) {
      const Explanation exact = explain(change.what, mean, change.size);
      change.size = exact.size;
      change.statistic = exact.explained * independent(since) / (scale * scale * information);
    }
    changes.push_back(change);
  }
  return changes;
}

std::vector<StageChange> ModelTracker::State::changes_of_noise(int since,
                                                               const Eigen::MatrixXcd& P_) const {
  // The first difference contains the transient of the change.
  const int differences = since - 1;
  Eigen::VectorXd power = Eigen::VectorXd::Zero(residual.rows());
  if (keeps(since)) {
    std::optional<Eigen::MatrixXcd> last;
    for (auto period = periods.end() - since; period != periods.end(); ++period) {
      Eigen::MatrixXcd now = residual_of(*period, P_);
      remove_trends(now);
      if (last) power += noise->relative_power(now - *last) / differences;
      last = std::move(now);
    }
  }
  const Eigen::VectorXd scores_since = detector->mean_scores(differences);
  std::vector<StageChange> changes;
  for (std::size_t h = 0; h < possible.size(); ++h) {
    if (possible[h].kind != ChangeKind::noise) continue;
    StageChange change;
    change.what = possible[h];
    change.periods = since;
    const double deviation = noise_deviation[change.what.index];
    const double score = keeps(since) ? (power[change.what.index] - 1.0) / deviation
                                      : scores_since[static_cast<Eigen::Index>(h)];
    change.size = std::sqrt(std::max(0.0, 1.0 + score * deviation)) - 1.0;
    // The scatter of a noise power is proportional to it.
    change.deviation = 0.5 * deviation * (1.0 + change.size) / std::sqrt(independent(differences));
    change.statistic = score * score * independent(differences);
    changes.push_back(change);
  }
  return changes;
}

StageChange ModelTracker::State::name(int since) const {
  std::vector<StageChange> changes = changes_of_response(since);
  const auto likeliest = std::ranges::max_element(changes, std::less<>(), &StageChange::statistic);
  const Eigen::MatrixXcd there =
      likeliest == changes.end() ? P : response.at(x + likeliest->size * likeliest->what.direction);
  for (StageChange& change : changes_of_noise(since, there)) changes.push_back(std::move(change));
  std::ranges::sort(changes, std::greater<>(), &StageChange::statistic);
  double sum = 0.0;
  for (const StageChange& change : changes)
    sum += std::exp(0.5 * (change.statistic - changes.front().statistic));
  StageChange& named = changes.front();
  named.probability = 1.0 / sum;
  if (changes.size() > 1) {
    named.otherwise = changes[1].what;
    named.other_probability = std::exp(0.5 * (changes[1].statistic - named.statistic)) / sum;
  }
  // Chance alone reaches this in 5 % of the disturbances.
  if (named.statistic < 2.0 * std::log(static_cast<double>(changes.size()) / 0.05))
    named.what = {ChangeKind::disturbance, 0, {}};
  return named;
}

ModelTracker::ModelTracker(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
                           const TrackerOptions& options) {
  if (frequency_hz.size() < 2)
    throw std::invalid_argument("fewer than 2 lines in the band of the model; nothing to track");
  if (!(model.sample_rate_hz > 0.0))
    throw std::invalid_argument("the model has no sample rate; tracking needs that of the data");
  if (options.learning_periods < 4)
    throw std::invalid_argument("learning needs at least 4 periods");
  if (!(options.memory_periods >= 1.0))
    throw std::invalid_argument("the memory must be at least one period");
  if (!(options.false_alarms_per_period > 0.0 && options.false_alarms_per_period <= 0.1))
    throw std::invalid_argument(
        "the rate of false alarms must be above 0 and at most 0.1 per period");
  state_ = std::make_unique<State>(model, frequency_hz, options);
  state_->start = Eigen::VectorXd::Zero(state_->response.size());
}

ModelTracker::~ModelTracker() = default;
ModelTracker::ModelTracker(ModelTracker&&) noexcept = default;
ModelTracker& ModelTracker::operator=(ModelTracker&&) noexcept = default;

void ModelTracker::change_excitation() {
  state_->periods.clear();
  state_->learned = false;
}

TrackedPeriod ModelTracker::add(const PeriodSpectra& period) {
  State& s = *state_;
  TrackedPeriod out;
  if (!s.learned) {
    s.periods.push_back(period);
    if (static_cast<int>(s.periods.size()) == s.options.learning_periods) s.learn();
    return out;
  }
  out.learning = false;
  Eigen::MatrixXcd residual = s.residual_of(period, s.P);
  s.remove_trends(residual);
  const Eigen::VectorXd z = s.J.transpose() * s.whitened(residual);
  if (s.last_residual) out.noise_power = s.noise->relative_power(residual - *s.last_residual);
  s.last_residual = residual;
  s.periods.push_back(period);
  if (s.periods.size() > kKept) s.periods.pop_front();
  const int found = s.detector->add(s.scores(z - s.gradient, out.noise_power));
  out.largest_statistic = s.detector->largest();
  out.threshold = s.detector->threshold();
  if (found == 0 && s.onset == 0) {
    s.filter.add(s.A, s.K, z - s.A * (s.filter.estimate() - s.x));
    return out;
  }
  s.onset = s.onset == 0 ? found : s.onset + 1;
  if (s.onset <= kToName) return out;
  out.change = s.name(s.onset - 1);
  s.onset = 0;
  if (out.change->what.kind == ChangeKind::disturbance) {
    s.detector->restart();
    return out;
  }
  s.start = s.x;
  if (out.change->what.direction.size() > 0)
    *s.start += out.change->size * out.change->what.direction;
  s.periods.clear();
  s.learned = false;
  return out;
}

const std::vector<TrackedParameter>& ModelTracker::parameters() const noexcept {
  return state_->response.parameters();
}
const Eigen::VectorXd& ModelTracker::estimate() const noexcept { return state_->filter.estimate(); }
Eigen::MatrixXd ModelTracker::covariance() const { return state_->filter.covariance(); }
const ReferenceQuality& ModelTracker::reference() const noexcept { return state_->quality; }

std::string describe(const PossibleChange& change, const ModelTracker& tracker,
                     const AdditiveModel& model) {
  switch (change.kind) {
    case ChangeKind::parameter:
      return describe(tracker.parameters()[static_cast<std::size_t>(change.index)], model);
    case ChangeKind::all_frequencies:
      return "frequencies of all modes";
    case ChangeKind::all_gains:
      return "gains of all sensors or of all actuators";
    case ChangeKind::disturbance:
      return "disturbance that has passed";
    case ChangeKind::noise:
      break;
  }
  return fmt::format("noise of sensor '{}'", model.outputs.name(change.index));
}

}  // namespace stageid
