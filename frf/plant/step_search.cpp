#include "frf/plant/step_search.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include "excitation/multisine/dft.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "frf/plant/detection_average.hpp"
#include "frf/response/channel_positions.hpp"
#include "frf/runs/byte_counter.hpp"
#include "frf/runs/run_periods.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/frequency_bands.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr Index kBins = Index{1} << 16;  // of commands from the lowest to the highest
constexpr int kPadding = 4;
constexpr Index kFewestSteps = 6;   // between them: fewer are a smooth curve
constexpr Index kMostSteps = 8192;  // eight bins per step
constexpr int kMostPeriods = 4;     // of a run
constexpr Index kNeighbours = 15;   // lines on each side, for the variance of the residual
constexpr double kSurely = 1e-10;   // probability of the peak without steps
constexpr double kOwnPower = 6.0;  // of an actuator at the step of others: one of 100 without steps
constexpr double kOwnCertainty = 30.0;  // of a peak anywhere: one of 1e10 without steps
constexpr double kHarmonic = 0.01;      // relative distance from a multiple of the step's frequency
constexpr int kRefinement = 20;         // steps from one point of the spectrum to the next

/// Points of the spectrum that are examined.
constexpr Index kFirstPoint = kFewestSteps * kPadding;
constexpr Index kPoints = kMostSteps * kPadding - kFirstPoint;

constexpr double kSmallestLimit = 0.05;  // of the largest command
constexpr double kLimitRatio = 0.95;     // of one tried limit to the next

constexpr Rounding kRoundings[] = {Rounding::nearest, Rounding::down, Rounding::to_zero};

/// Matched residuals of one actuator, by its command.
class CommandHistogram {
 public:
  void add(const Eigen::Ref<const Eigen::VectorXd>& commands, const Eigen::VectorXd& matched,
           double largest) {
    allocate();
    for (Index t = 0; t < commands.size(); ++t) {
      const double position = 0.5 * (commands[t] / largest + 1.0) * static_cast<double>(kBins);
      const auto bin = std::clamp<Index>(static_cast<Index>(position), 0, kBins - 1);
      sum_[bin] += matched[t];
      count_[bin] += 1.0;
    }
    power_ += matched.squaredNorm();
  }
  void add(const CommandHistogram& other) {
    if (other.sum_.size() == 0) return;
    allocate();
    sum_ += other.sum_;
    count_ += other.count_;
    power_ += other.power_;
  }

  /// Powers with the mean 1 without steps, for kPadding points per period in the range of commands.
  Eigen::VectorXd spectrum(RealDft& dft) const {
    std::fill(dft.input().begin(), dft.input().end(), 0.0);
    std::copy(sum_.begin(), sum_.end(), dft.input().begin());
    const auto values = dft.forward();
    Eigen::VectorXd power(static_cast<Index>(values.size()));
    for (std::size_t k = 0; k < values.size(); ++k) power[k] = std::norm(values[k]);
    Eigen::VectorXd sorted = power.head(kMostSteps * kPadding);
    const double median =
        order_statistic({sorted.data(), static_cast<std::size_t>(sorted.size())}, 0.5);
    if (median > 0.0) power *= std::numbers::ln2 / median;
    return power;
  }

 private:
  void allocate() {
    if (sum_.size() > 0) return;
    sum_.setZero(kBins);
    count_.setZero(kBins);
  }

  friend class OccupiedBins;

  Eigen::VectorXd sum_;    // empty before the first sample
  Eigen::VectorXd count_;  // of samples
  double power_ = 0.0;
};

/// The bins of a histogram that have samples.
class OccupiedBins {
 public:
  OccupiedBins() = default;
  OccupiedBins(const CommandHistogram& all, double largest) {
    std::vector<Index> bins;
    for (Index b = 0; b < all.count_.size(); ++b)
      if (all.count_[b] > 0.0) bins.push_back(b);
    if (bins.empty()) return;
    const double end = largest * (1.0 - 1.0 / static_cast<double>(kBins));
    commands_ = Eigen::VectorXd::LinSpaced(kBins, -end, end)(bins);  // middles of bins
    sum_ = all.sum_(bins);
    count_ = all.count_(bins);
    samples_ = count_.sum();
    power_ = all.power_ / samples_;
    centred_ = commands_.array() - commands_.dot(count_) / samples_;
    weighted_ = centred_.cwiseProduct(count_);
    moment_ = weighted_.dot(centred_);
  }

  /// Power of the residuals explained by this converter, over their mean power per sample; 0 if the sign of its error is
  /// opposite. The response contains the part of the error that is linear in the commands.
  double explained(const ActuatorStep& candidate) const {
    if (!(power_ > 0.0)) return 0.0;
    Eigen::VectorXd error = commands_.unaryExpr([&](double u) { return candidate.applied(u) - u; });
    error.array() -= error.dot(count_) / samples_;
    error -= centred_ * (weighted_.dot(error) / moment_);
    const double match = error.dot(sum_);
    const double energy = error.cwiseAbs2().dot(count_);
    return match > 0.0 && energy > 0.0 ? match * match / energy / power_ : 0.0;
  }

 private:
  Eigen::VectorXd commands_, sum_, count_;
  Eigen::VectorXd centred_, weighted_;  // commands without their mean; times the number of samples
  double samples_ = 0.0;
  double power_ = 0.0;   // of a sample
  double moment_ = 0.0;  // sum of the squares of the centred commands
};

/// An actuator without a known step.
struct Tested {
  Index input = 0;       ///< of the response
  Index actuator = 0;    ///< of the log
  double largest = 0.0;  ///< command of all actuators with its unit
  CommandHistogram histogram;
  OccupiedBins bins;  ///< of the complete histogram
};
using Members = std::vector<const Tested*>;

/// How well a converter explains the residuals of these actuators.
double explained(const ActuatorStep& candidate, const Members& members) {
  double sum = 0.0;
  for (const Tested* t : members) sum += t->bins.explained(candidate);
  return sum;
}

/// The step for one actuator, with another rounding if that clearly explains more.
ActuatorStep with_own_rounding(ActuatorStep step, const Tested& t) {
  double most = explained(step, {&t}) + kOwnCertainty;
  step.actuator = t.actuator;
  for (const Rounding rounding : kRoundings) {
    const double now = explained({0, step.step, rounding}, {&t});
    if (now <= most) continue;
    most = now;
    step.rounding = rounding;
  }
  return step;
}

/// The steps near `position` of the spectrum that explain the residuals best: one step for all, and the same rounding
/// unless an actuator clearly has another one.
std::vector<ActuatorStep> refined(double position, const Members& members) {
  ActuatorStep common;
  double most = 0.0;
  for (int shift = -kRefinement; shift <= kRefinement; ++shift)
    for (const Rounding rounding : kRoundings) {
      const double cycles = (position + static_cast<double>(shift) / kRefinement) / kPadding;
      const ActuatorStep candidate{0, 2.0 * members.front()->largest / cycles, rounding};
      const double now = explained(candidate, members);
      if (now <= most) continue;
      most = now;
      common = candidate;
    }
  std::vector<ActuatorStep> steps;
  if (!(most > 0.0)) return steps;
  for (const Tested* t : members) steps.push_back(with_own_rounding(common, *t));
  return steps;
}

/// The limit that explains the residuals of these actuators best.
ActuatorStep best_limit(const Members& members) {
  ActuatorStep best{0, members.front()->largest, Rounding::limited};
  double most = 0.0;
  const double largest = members.front()->largest;
  for (double limit = kLimitRatio * largest; limit > kSmallestLimit * largest;
       limit *= kLimitRatio) {
    const double now = explained({0, limit, Rounding::limited}, members);
    if (now <= most) continue;
    most = now;
    best.step = limit;
  }
  return best;
}

Eigen::MatrixXd spectra_of(const Members& members) {
  RealDft dft(kPadding * static_cast<int>(kBins));
  Eigen::MatrixXd spectra(kPoints, static_cast<Index>(members.size()));
  for (std::size_t m = 0; m < members.size(); ++m)
    spectra.col(m) = members[m]->histogram.spectrum(dft).segment(kFirstPoint, kPoints);
  return spectra;
}

/// Adds the members for which no step of their own explains clearly more than that of others: with commands of a few
/// steps, a spectrum has several peaks, and the errors of the other converters hide the own one.
void add_those_explained_by(const ActuatorStep& step, Members& members,
                            std::vector<ActuatorStep>& found) {
  if (members.empty()) return;
  const Eigen::MatrixXd spectra = spectra_of(members);
  Members others;
  for (std::size_t m = 0; m < members.size(); ++m) {
    const Tested* t = members[m];
    Index peak = 0;
    spectra.col(m).maxCoeff(&peak);
    const ActuatorStep common = with_own_rounding(step, *t);
    const double by_common = explained(common, {t});
    const std::vector<ActuatorStep> own = refined(static_cast<double>(kFirstPoint + peak), {t});
    const double by_own = own.empty() ? 0.0 : explained(own.front(), {t});
    if (by_common > kOwnPower && by_common + std::min(kOwnCertainty, by_common) > by_own)
      found.push_back(common);
    else
      others.push_back(t);
  }
  members = std::move(others);
}

/// Whether an actuator with these powers has the step at `point`: there is power, and no stronger one at another step.
bool has_step_at(Index point, const Eigen::Ref<const Eigen::VectorXd>& powers) {
  const Index first = std::clamp<Index>(point - kPadding, 0, kPoints - 1);
  const Index number = std::clamp<Index>(point + kPadding + 1, 1, kPoints) - first;
  if (powers.segment(first, number).maxCoeff() < kOwnPower) return false;
  Index own = 0;
  if (powers.maxCoeff(&own) < kOwnCertainty) return true;
  const double ratio =
      static_cast<double>(own + kFirstPoint) / static_cast<double>(point + kFirstPoint);
  return std::abs(ratio - std::round(ratio)) < kHarmonic * ratio && ratio > 0.5;
}

/// Moves the members that have the step at `point` of the spectrum to the result.
Members take_those_at(Index point, const Eigen::MatrixXd& spectra, Members& members) {
  Members with;
  Members without;
  for (std::size_t m = 0; m < members.size(); ++m)
    (has_step_at(point, spectra.col(m)) ? with : without).push_back(members[m]);
  members = std::move(without);
  return with;
}

class StepSearch {
 public:
  StepSearch(const std::vector<RealizationRuns>& realizations, const FrfEstimate& frf,
             const FrfOptions& options);
  std::vector<ActuatorStep> find();

 private:
  const std::string& unit(Index actuator) const { return info_.actuators.unit(actuator); }
  std::vector<char> excited_by(const UsedRun& run, RealDft& dft) const;
  void find_largest_commands();
  void collect();
  void collect(const UsedRun& run, RunWorkspace& w, std::vector<CommandHistogram>& own);
  Eigen::MatrixXcd residual(RunWorkspace& w) const;
  void find(Members members, std::vector<ActuatorStep>& found) const;
  void find_limits(const Members& members, std::vector<ActuatorStep>& found) const;

  const LogInfo& info_;
  int workers_;
  ByteCounter bytes_;
  std::vector<const UsedRun*> runs_;
  std::vector<ActuatorStep> known_;
  std::vector<Index> outputs_;  // of the log
  std::vector<Index> inputs_;   // of the log
  std::vector<Tested> tested_;
  std::vector<int> lines_;             // excited and detection lines
  std::vector<Eigen::MatrixXcd> G_{};  // on lines_
};

StepSearch::StepSearch(const std::vector<RealizationRuns>& realizations, const FrfEstimate& frf,
                       const FrfOptions& options)
    : info_(realizations.front().runs.front().log->info()),
      workers_(worker_count(options.threads)),
      bytes_(options, realizations),
      outputs_(channel_positions(info_.sensors, frf.outputs.names, "outputs", "sensor")),
      inputs_(channel_positions(info_.actuators, frf.inputs.names, "inputs", "actuator")) {
  for (const RealizationRuns& realization : realizations)
    for (const UsedRun& run : realization.runs) runs_.push_back(&run);
  if (runs_.front()->earlier != nullptr) known_ = runs_.front()->earlier->steps;
  for (std::size_t j = 0; j < inputs_.size(); ++j)
    if (std::ranges::find(known_, inputs_[j], &ActuatorStep::actuator) == known_.end())
      tested_.push_back({static_cast<Index>(j), inputs_[j], 0.0, {}, {}});
  std::vector<int> excited;
  for (const double f : frf.frequency_hz)
    excited.push_back(
        static_cast<int>(std::lround(f * info_.period_samples / info_.sample_rate_hz)));
  lines_ = detection_lines(excited);
  lines_.insert(lines_.end(), excited.begin() + 1, excited.end());  // the first has none below it
  std::ranges::sort(lines_);
  for (const int line : lines_) {
    const Eigen::VectorXcd g = interpolated_response(excited, line, frf.response);
    G_.push_back(Eigen::Map<const Eigen::MatrixXcd>(g.data(), frf.n_outputs(), frf.n_inputs()));
  }
}

/// Whether the run excites each tested actuator; true if this is unknown.
std::vector<char> StepSearch::excited_by(const UsedRun& run, RealDft& dft) const {
  const std::vector<std::string>& axes = info_.excitation.names;
  const std::vector<Index> channels = read_run_excitation(run, dft).spectrum.channels;
  std::vector<char> excited;
  for (const Tested& t : tested_) {
    const auto axis = std::ranges::find(axes, info_.actuators.name(t.actuator));
    excited.push_back(axis == axes.end() ||
                      std::ranges::find(channels, axis - axes.begin()) != channels.end());
  }
  return excited;
}

/// From the first period of each run.
void StepSearch::find_largest_commands() {
  std::vector<Eigen::VectorXd> largest(runs_.size());
  for_each_task(workers_, runs_.size(), [&](int, std::size_t r) {
    const auto samples = static_cast<std::uint64_t>(info_.period_samples);
    LogSamples period;
    runs_[r]->log->read(runs_[r]->index,
                        samples * static_cast<std::uint64_t>(runs_[r]->transient_periods), samples,
                        period);
    largest[r] = period.actuators.cwiseAbs().colwise().maxCoeff();
  });
  for (Tested& t : tested_)
    for (const Tested& other : tested_)
      for (const Eigen::VectorXd& run : largest)
        if (unit(other.actuator) == unit(t.actuator))
          t.largest = std::max(t.largest, run[other.actuator]);
}

/// Y - G U of the period in the workspace: n_y x lines.
Eigen::MatrixXcd StepSearch::residual(RunWorkspace& w) const {
  const auto n_y = static_cast<Index>(outputs_.size());
  Eigen::MatrixXcd Z(n_y + static_cast<Index>(inputs_.size()), static_cast<Index>(lines_.size()));
  line_spectra(w.samples.sensors, outputs_, lines_, 0, w.dft, Z);
  line_spectra(w.samples.actuators, inputs_, lines_, n_y, w.dft, Z);
  Eigen::MatrixXcd E = Z.topRows(n_y);
  for (Index k = 0; k < E.cols(); ++k) E.col(k).noalias() -= G_[k] * Z.col(k).tail(Z.rows() - n_y);
  return E;
}

void StepSearch::collect(const UsedRun& run, RunWorkspace& w, std::vector<CommandHistogram>& own) {
  const std::vector<char> excited = excited_by(run, w.dft);
  std::vector<Eigen::MatrixXd> commands;
  std::vector<Eigen::MatrixXcd> residuals;
  UsedRun some = run;
  some.periods = std::min(run.periods, kMostPeriods);
  for_each_period(
      some, w, [this](double bytes) { bytes_.add(bytes); },
      [&](int) {
        commands.push_back(w.samples.actuators);
        residuals.push_back(residual(w));
      },
      [](int, const std::string&) {});
  if (residuals.empty()) return;
  Eigen::MatrixXd power = Eigen::MatrixXd::Zero(residuals.front().rows(), residuals.front().cols());
  for (const Eigen::MatrixXcd& E : residuals) power += E.cwiseAbs2();
  Eigen::MatrixXd variance(power.rows(), power.cols());
  for (Index k = 0; k < power.cols(); ++k) variance.col(k) = mean_around(power, k, kNeighbours);
  Eigen::VectorXcd half = Eigen::VectorXcd::Zero(w.dft.half_size());
  for (std::size_t p = 0; p < residuals.size(); ++p)
    for (std::size_t a = 0; a < tested_.size(); ++a) {
      if (!excited[a]) continue;
      for (Index k = 0; k < variance.cols(); ++k) {
        std::complex<double> matched = 0.0;
        for (Index i = 0; i < variance.rows(); ++i)
          if (variance(i, k) > 0.0)
            matched += std::conj(G_[k](i, tested_[a].input)) * residuals[p](i, k) / variance(i, k);
        half[lines_[k]] = matched;
      }
      own[a].add(commands[p].col(tested_[a].actuator), w.dft.inverse(half), tested_[a].largest);
    }
}

/// In batches, whose sums do not depend on the number of threads.
void StepSearch::collect() {
  RunWorkers workers(workers_, runs_.size(), info_.period_samples);
  const auto batch = static_cast<std::size_t>(workers_);
  for (std::size_t first = 0; first < runs_.size(); first += batch) {
    std::vector<std::vector<CommandHistogram>> own(std::min(batch, runs_.size() - first));
    workers.for_each(own.size(), [&](RunWorkspace& workspace, std::size_t r) {
      own[r].resize(tested_.size());
      collect(*runs_[first + r], workspace, own[r]);
    });
    for (const auto& of_run : own)
      for (std::size_t a = 0; a < tested_.size(); ++a) tested_[a].histogram.add(of_run[a]);
  }
  for (Tested& t : tested_) t.bins = OccupiedBins(t.histogram, t.largest);
}

/// Finds steps of `members`, all of one unit. First those of known actuators, then common ones.
void StepSearch::find(Members members, std::vector<ActuatorStep>& found) const {
  for (const ActuatorStep& step : known_) {
    if (members.empty()) return;
    const double point = 2.0 * members.front()->largest * kPadding / step.step - kFirstPoint;
    if (unit(step.actuator) == unit(members.front()->actuator) && point > 0.0 && point < kPoints)
      for (const Tested* t : take_those_at(std::lround(point), spectra_of(members), members))
        found.push_back({t->actuator, step.step, step.rounding});
  }
  while (!members.empty()) {
    const Eigen::MatrixXd spectra = spectra_of(members);
    Index peak = 0;
    const double sum = spectra.rowwise().sum().maxCoeff(&peak);
    const double independent = static_cast<double>(kPoints) / kPadding;
    if (independent * tail_of_evidence(sum, spectra.cols()) > kSurely) return;
    const Members with = take_those_at(peak, spectra, members);
    if (with.empty()) return;
    const std::vector<ActuatorStep> steps = refined(static_cast<double>(kFirstPoint + peak), with);
    if (steps.empty()) return;
    found.insert(found.end(), steps.begin(), steps.end());
    add_those_explained_by(steps.front(), members, found);
  }
}

/// Adds the limits of `members`, all of one unit, where they explain more than steps: a common one, unless an actuator
/// clearly has another one. The corners of a limited command are periodic in no step.
void StepSearch::find_limits(const Members& members, std::vector<ActuatorStep>& found) const {
  const ActuatorStep common = best_limit(members);
  for (const Tested* t : members) {
    ActuatorStep limit = best_limit({t});
    if (explained(limit, {t}) < explained(common, {t}) + kOwnCertainty) limit = common;
    limit.actuator = t->actuator;
    const auto step = std::ranges::find(found, t->actuator, &ActuatorStep::actuator);
    const double by_step = step == found.end() ? kOwnCertainty : explained(*step, {t});
    if (explained(limit, {t}) < by_step) continue;
    if (step == found.end())
      found.push_back(limit);
    else
      *step = limit;
  }
}

std::vector<ActuatorStep> StepSearch::find() {
  std::vector<ActuatorStep> found;
  if (lines_.size() < static_cast<std::size_t>(kNeighbours) || tested_.empty()) return found;
  find_largest_commands();
  std::erase_if(tested_, [](const Tested& t) { return !(t.largest > 0.0); });
  collect();
  std::vector<std::string> units;
  for (const Tested& t : tested_)
    if (std::ranges::find(units, unit(t.actuator)) == units.end())
      units.push_back(unit(t.actuator));
  for (const std::string& one : units) {
    Members members;
    for (const Tested& t : tested_)
      if (unit(t.actuator) == one) members.push_back(&t);
    find(members, found);
    find_limits(members, found);
  }
  return found;
}

}  // namespace

std::vector<ActuatorStep> find_actuator_steps(const std::vector<RealizationRuns>& realizations,
                                              const FrfEstimate& frf, const FrfOptions& options) {
  return StepSearch(realizations, frf, options).find();
}

}  // namespace stageid
