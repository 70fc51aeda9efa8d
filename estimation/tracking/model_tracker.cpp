#include "estimation/tracking/model_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "estimation/tracking/change_detector.hpp"
#include "estimation/tracking/change_naming.hpp"
#include "estimation/tracking/change_scores.hpp"
#include "estimation/tracking/forgetting_filter.hpp"
#include "estimation/tracking/tracked_response.hpp"
#include "estimation/tracking/tracking_reference.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

/// Periods that are kept to name a change.
constexpr std::size_t kKept = 32;

}  // namespace

struct ModelTracker::State {
  State(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
        const TrackerOptions& wanted)
      : options(wanted),
        response(
            model,
            tracked_parameters(model, {frequency_hz[0], frequency_hz[frequency_hz.size() - 1]}),
            frequency_hz),
        filter(prior_information(response.parameters(), model.sample_rate_hz),
               std::exp(-1.0 / wanted.memory_periods)),
        start(Eigen::VectorXd::Zero(response.size())) {}

  void learn();
  TrackedPeriod watch(const PeriodSpectra& period);
  Eigen::VectorXd statistics() const;
  /// Adds the gradients of some periods to the tracked estimate.
  void track(const Eigen::VectorXd& mean_gradient, int count);

  TrackerOptions options;
  TrackedResponse response;
  ForgettingFilter filter;
  std::optional<Eigen::VectorXd> start;  ///< of the next learning; none: the estimate continues
  std::deque<PeriodSpectra> periods;     ///< to learn from; else the last ones
  ReferenceQuality quality;
  // None while learning.
  std::optional<TrackingReference> reference;
  std::optional<ChangeScores> scores;
  std::optional<ChangeDetector> detector;
  std::optional<Eigen::MatrixXcd> last_residual;
  int onset = 0;  ///< periods since a change that has no name yet
};

void ModelTracker::State::track(const Eigen::VectorXd& mean_gradient, int count) {
  const Eigen::MatrixXd& A = reference->information();
  filter.add(A, reference->covariance(),
             count * (mean_gradient - A * (filter.estimate() - reference->x())), count);
}

void ModelTracker::State::learn() {
  const Eigen::VectorXd x = start.value_or(filter.estimate());
  if (start) filter.forget();
  start.reset();
  reference.emplace(response, periods, x, filter);
  track(reference->mean_gradient(), options.learning_periods);
  quality = reference->quality();
  scores.emplace(possible_changes(response.model(), response.parameters(),
                                  reference->periods() * reference->information()),
                 *reference);
  detector.emplace(scores->correlation(), scores->freedom(), options.false_alarms_per_period,
                   options.learning_periods);
  periods.clear();
  last_residual.reset();
  onset = 0;
}

Eigen::VectorXd ModelTracker::State::statistics() const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(response.size() + response.model().n_outputs());
  for (std::size_t h = 0; h < scores->possible().size(); ++h) {
    const PossibleChange& change = scores->possible()[h];
    const double value = detector->largest_by_hypothesis()[h];
    if (change.kind == ChangeKind::parameter) out[change.index] = value;
    if (change.kind == ChangeKind::noise) out[response.size() + change.index] = value;
  }
  return out;
}

TrackedPeriod ModelTracker::State::watch(const PeriodSpectra& period) {
  TrackedPeriod out;
  out.learning = false;
  Eigen::MatrixXcd residual = reference->residual(period, reference->response());
  const Eigen::VectorXd gradient = reference->gradient(residual);
  if (last_residual) out.noise_power = reference->noise_power(residual - *last_residual);
  last_residual = std::move(residual);
  periods.push_back(period);
  if (periods.size() > kKept) periods.pop_front();
  const int found =
      detector->add(scores->of(gradient - reference->mean_gradient(), out.noise_power));
  out.largest_statistic = detector->largest();
  out.threshold = detector->threshold();
  out.statistics = statistics();
  if (found == 0 && onset == 0) {
    track(gradient, 1);
    return out;
  }
  onset = onset == 0 ? found : onset + 1;
  if (onset <= kPeriodsToName) return out;
  // The period of the change contains its transient.
  const int since = std::exchange(onset, 0) - 1;
  out.change = name_change(response, *reference, *scores, periods, since,
                           detector->mean_scores(since), detector->mean_scores(since - 1));
  if (out.change->what.kind == ChangeKind::disturbance) {
    detector->restart();
    return out;
  }
  if (out.change->what.kind != ChangeKind::motion) start = reference->x();
  if (out.change->what.direction.size() > 0)
    *start += out.change->size * out.change->what.direction;
  periods.clear();
  reference.reset();
  return out;
}

ModelTracker::ModelTracker(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
                           const TrackerOptions& options) {
  require(frequency_hz.size() >= 2,
          "fewer than 2 lines in the band of the model; nothing to track");
  require(model.sample_rate_hz > 0.0,
          "the model has no sample rate; tracking needs that of the data");
  require(options.learning_periods >= 4, "learning needs at least 4 periods");
  require(options.memory_periods >= 1.0,
          "the memory must be at least one period; make it several periods long");
  require(options.false_alarms_per_period > 0.0 && options.false_alarms_per_period <= 0.1,
          "the rate of false alarms must be above 0 and at most 0.1 per period; choose one such as "
          "1/year");
  state_ = std::make_unique<State>(model, frequency_hz, options);
}

ModelTracker::~ModelTracker() = default;
ModelTracker::ModelTracker(ModelTracker&&) noexcept = default;
ModelTracker& ModelTracker::operator=(ModelTracker&&) noexcept = default;

void ModelTracker::change_excitation() {
  state_->periods.clear();
  state_->reference.reset();
}

TrackedPeriod ModelTracker::add(const PeriodSpectra& period) {
  if (state_->reference) return state_->watch(period);
  state_->periods.push_back(period);
  if (static_cast<int>(state_->periods.size()) == state_->options.learning_periods) state_->learn();
  return {};
}

const std::vector<TrackedParameter>& ModelTracker::parameters() const noexcept {
  return state_->response.parameters();
}
const Eigen::VectorXd& ModelTracker::estimate() const noexcept { return state_->filter.estimate(); }
Eigen::MatrixXd ModelTracker::covariance() const { return state_->filter.covariance(); }
Eigen::MatrixXcd ModelTracker::response() const { return state_->response.at(estimate()); }

Eigen::MatrixXd ModelTracker::response_variance() const {
  const TrackedResponse& response = state_->response;
  const Eigen::Index n_y = response.model().n_outputs();
  const Eigen::Index n_u = response.model().n_inputs();
  const Eigen::MatrixXd C = covariance();
  Eigen::MatrixXd out(n_y * n_u, response.lines());
  for (Eigen::Index j = 0; j < n_u; ++j) {
    Eigen::MatrixXcd one_input = Eigen::MatrixXcd::Zero(n_u, response.lines());
    one_input.row(j).setOnes();
    const Eigen::MatrixXcd D = response.derivatives(estimate(), one_input);
    const Eigen::VectorXd variance = (D * C).cwiseProduct(D.conjugate()).rowwise().sum().real();
    out.middleRows(j * n_y, n_y) = variance.reshaped(n_y, out.cols());
  }
  return out;
}

const ReferenceQuality& ModelTracker::reference() const noexcept { return state_->quality; }

}  // namespace stageid
