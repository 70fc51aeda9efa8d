#include "frf/health/data_health.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "frf/health/health_measures.hpp"
#include "frf/health/transient_check.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "frf/wiring/examination.hpp"
#include "frf/wiring/excitation_timing.hpp"
#include "frf/wiring/recorded_channels_check.hpp"
#include "frf/wiring/timing_check.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kSuspicion = 0.05;   // of clipping, if u = r - C y is violated
constexpr double kStuckShare = 0.02;  // of a run's samples that have one value
constexpr double kCoarse =
    25.0;  // times the longest expected sequence: motion is slow and differs between runs
constexpr double kExcludedPower = 1e-4;   // of the inputs' power, where the noise is unknown
constexpr double kWorstExcitation = 1e3;  // cond(R)
constexpr double kWorstInputs = 1e2;      // median of cond(U) in the upper half of the band
constexpr double kLeastCoherence = 0.9;
constexpr double kMovedTogether = 0.5;  // coherence of two sensors beside the excitation
constexpr double kUnexplained = 0.9;  // of the power of C y, most of which leaks from a limit cycle
constexpr double kCertain = 1e6;      // evidence if there is no noise

/// Whether it is about the whole log, not about the recording of one realization.
bool is_of_log(const Finding& f) {
  return f.severity == Severity::unchecked || f.cause == Cause::unknown_stage;
}

}  // namespace

const std::string& Examination::name(Index channel) const {
  return channel < record_.n_y() ? record_.info.sensors.name(channel)
                                 : record_.info.actuators.name(channel - record_.n_y());
}

bool Examination::found(Cause cause) const {
  return std::ranges::find(findings_, cause, &Finding::cause) != findings_.end();
}

void Examination::check_cycles() {
  const RunHealth& health = record_.health;
  if (health.marked + health.missing > 0)
    find(Severity::doubt, Cause::marked, "", "samples are marked as unusable",
         fmt::format("{} of {} cycles", health.marked + health.missing, health.cycles),
         "their periods are discarded; repeat the runs if there are many");
  if (health.late > 0)
    find(Severity::doubt, Cause::late, "",
         "cycles were late, so the phase of the loop differs from the model",
         fmt::format("{} of {}, the latest by {:.3g} us", health.late, health.cycles,
                     1e-3 * static_cast<double>(health.largest_lateness_ns)),
         "reserve a processor core for the loop ('realtime' in the stage file)");
}

void Examination::check_samples() {
  for (const ActuatorStep& step : record_.steps)
    if (step.rounding == Rounding::limited) spoilt_.push_back(record_.n_y() + step.actuator);
  const double limit = std::log(kSignificance / (2.0 * static_cast<double>(record_.scan.size())));
  const auto run_samples =
      static_cast<double>(record_.periods.empty() ? 1
                                                  : *std::ranges::max_element(record_.periods)) *
      record_.info.period_samples;
  for (Index c = 0; c < static_cast<Index>(record_.scan.size()); ++c) {
    const ChannelScan& scan = record_.scan[c];
    const bool sensor = c < record_.n_y();
    const auto stuck = static_cast<double>(scan.longest_constant());
    // Coarse steps repeat values everywhere, a stuck channel does not.
    const double expected = std::min(kCoarse * scan.expected_constant(), 0.5 * run_samples);
    const bool piles_up = std::min(scan.log_p_high(), scan.log_p_low()) < limit;
    // A channel that is not driven may be constant, and a constant run is not clipped.
    if (stuck > std::max({kStuckShare * run_samples, 2.0, expected}) &&
        !(piles_up && scan.returns())) {
      const auto excited = excited_actuators();
      const bool driven = sensor ? expected_to_respond(c).value_or(true)
                                 : std::ranges::find(excited, c - record_.n_y()) != excited.end();
      if (!driven) continue;
      const std::string figure = fmt::format("{:.3g} s", stuck / record_.info.sample_rate_hz);
      if (scan.is_coarse())
        find(Severity::fault, Cause::resolution, name(c),
             "repeats one value: it moves by less than a step of its converter, or is dead", figure,
             "raise the level or use a finer range, or check its cable, then measure again");
      else
        find(Severity::fault, Cause::dead, name(c), "dead: repeats one value", figure,
             "check its cable and amplifier, then measure again");
      spoilt_.push_back(c);
      continue;
    }
    if (piles_up) find_clipped(c, limit);
  }
}

/// @param log_p below this, an end of the range counts as clipped
void Examination::find_clipped(Index c, double log_p) {
  const ChannelScan& scan = record_.scan[c];
  const bool sensor = c < record_.n_y();
  const bool high = scan.log_p_high() <= log_p;
  const bool low = scan.log_p_low() <= log_p;
  const std::string& unit =
      sensor ? record_.info.sensors.unit(c) : record_.info.actuators.unit(c - record_.n_y());
  find(Severity::fault, Cause::saturated, name(c), "clipped: it stays at the end of its range",
       fmt::format("{} at {:.4g} {}",
                   counted((high ? scan.high().count : 0) + (low ? scan.low().count : 0), "sample"),
                   high ? scan.high().value : scan.low().value, unit),
       sensor ? "lower the level, or widen the sensor's range, and measure again"
              : "lower the level, or raise the actuator's limit, and measure again");
  spoilt_.push_back(c);
}

/// If u = r - C y is violated, a few samples at an end of the range suffice as explanation. Reports the most
/// clipped of `count` channels, starting at `first`.
bool Examination::find_suspected(Index first, Index count) {
  const auto log_p = [this](Index c) {
    const ChannelScan& scan = record_.scan[c];
    return scan.log_p_high() + scan.log_p_low();
  };
  Index most = first;
  for (Index c = first; c < first + count; ++c)
    if (log_p(c) < log_p(most)) most = c;
  if (log_p(most) > std::log(kSuspicion)) return false;
  find_clipped(most, 0.5 * std::log(kSuspicion));
  return true;
}

/// Whether the motion of the nominal rigid body under the recorded inputs is above the noise of this sensor.
bool Examination::expected_above_noise(Index sensor) const {
  if (!expected_to_respond(sensor).value_or(false)) return false;
  const auto y = positions_in(nominal_->sensors, record_.info.sensors.names);
  const auto u = positions_in(nominal_->actuators, record_.info.actuators.names);
  return above_noise(record_, sensor, [&](Index k) -> Eigen::RowVectorXcd {
    const Eigen::MatrixXcd G = nominal_->rigid_body(record_.frequency_hz[k])(y, u);
    const LineRecord& line = record_.lines[k];
    return G.row(sensor) * record_.mean(line.Z.bottomRows(record_.n_u()));
  });
}

/// Sensors on which the excitation does not show, because the stage moves by more on its own.
void Examination::find_drowned(const std::vector<Index>& sensors) {
  if (sensors.empty()) return;
  std::string names;
  if (static_cast<Index>(sensors.size()) < record_.n_y())
    for (const Index s : sensors) names += (names.empty() ? "" : " ") + name(s);
  const std::string figure =
      fmt::format("no line of {} is above its other motion", counted(sensors.size(), "sensor"));
  const bool hidden =
      std::ranges::none_of(sensors, [this](Index s) { return expected_above_noise(s); });
  // Forces act within the loop: u = r - C y holds in every period. A setpoint enters u beside it.
  if (nominal_ && nominal_->controller && hidden && why_no_nominal(true).empty() &&
      unexplained_motion(record_, *nominal_) < kUnexplained)
    find(Severity::fault, Cause::incoherent, names,
         "noise hides the response: of the sensors, of forces on the stage, or of a loop that "
         "oscillates, as coarse steps of the command or friction cause",
         figure, kRemedyOfLimitCycle);
  else
    find(Severity::fault, Cause::incoherent, names,
         "no signal repeats with the excitation: a disturbance or a moving setpoint moves the "
         "stage, or the excitation does not reach it",
         figure,
         "keep the setpoint constant, raise the level or check the injection, then measure again");
}

void Examination::check_responses() {
  std::vector<bool> responding;
  for (Index s = 0; s < record_.n_y(); ++s) responding.push_back(responds(record_, s));
  const bool none = std::ranges::find(responding, true) == responding.end();
  // Dead sensors have independent noise; what moves the stage moves several.
  const auto moves = [this](Index s) {
    for (Index other = 0; other < record_.n_y(); ++other)
      if (other != s && !spoilt(other) && common_motion(record_, s, other) > kMovedTogether)
        return true;
    return false;
  };
  std::vector<Index> drowned;
  for (Index s = 0; s < record_.n_y(); ++s) {
    if (spoilt(s)) continue;
    const std::optional<bool> expected = expected_to_respond(s);
    if (!responding[s]) {
      if (none && spoilt_.empty()) {
        drowned.push_back(s);
      } else if (expected == false) {
        continue;
      } else if (moves(s) || (expected == true && !expected_above_noise(s))) {
        drowned.push_back(s);
      } else {
        find(expected ? Severity::fault : Severity::doubt, Cause::dead, name(s),
             expected
                 ? "dead: only noise, although the rigid body moves it"
                 : "no response to the excitation: the sensor is dead, or these axes do not move "
                   "it",
             "no line above the noise",
             expected ? "check its cable and power supply, then measure again"
                      : "exclude it with --outputs, or check its cable");
        spoilt_.push_back(s);
      }
      continue;
    }
    const double coherence = median_coherence(record_, s);
    // A dead sensor in the loop disturbs the others.
    if (expected == true && spoilt_.empty() && coherence < kLeastCoherence)
      find(Severity::doubt, Cause::incoherent, name(s),
           "most of its signal does not repeat from period to period",
           fmt::format("median coherence {:.2f}", coherence),
           "raise the level, or measure more periods");
  }
  find_drowned(drowned);
}

/// Signals per excitation, X = Z R^-1: an axis is not driven if its column of X is noise in every channel. One F
/// test per line and channel, combined by Fisher's sum over the lines.
void Examination::check_arrival() {
  const auto axes = static_cast<Index>(record_.axes.size());
  const int dof = record_.scatter_dof();
  if (axes < 2 || record_.zippered || dof == 0 || record_.experiments() != axes) return;
  const Index channels = record_.n_y() + record_.n_u();
  Eigen::MatrixXd evidence = Eigen::MatrixXd::Zero(channels, axes);
  Index lines = 0;
  for (const LineRecord& line : record_.lines) {
    const Eigen::MatrixXcd R = line.R(record_.axes, Eigen::all);
    if (!(condition(R) < kWorstExcitation)) continue;  // check_excitation() reports this
    ++lines;
    const Eigen::MatrixXcd inverse = R.inverse();
    const Eigen::MatrixXcd X = record_.mean(line.Z) * inverse;
    const Eigen::VectorXd variance = record_.variance_of_mean(line.Z);
    for (Index a = 0; a < axes; ++a)
      for (Index c = 0; c < channels; ++c) {
        const double noise = variance[c] * inverse.col(a).squaredNorm();
        const double power = std::norm(X(c, a));
        if (power > 0.0)
          evidence(c, a) -= noise > 0.0 ? log_tail_of_f(power / noise, 1, dof) : -kCertain;
      }
  }
  const double tests = static_cast<double>(channels * axes);
  for (Index a = 0; a < axes; ++a) {
    bool driven = lines == 0;
    for (Index c = 0; c < channels; ++c)
      driven = driven || tail_of_evidence(evidence(c, a), lines) < kSignificance / tests;
    if (driven) continue;
    find(Severity::fault, Cause::excitation, record_.info.excitation.name(record_.axes[a]),
         "the excitation does not reach the stage: no channel responds to it",
         "no line above the noise",
         "check the injection of this axis and measure again, or exclude it with --inputs");
  }
}

void Examination::check_excitation() {
  if (record_.axes.empty() || record_.zippered) return;  // zippered axes have no common lines
  double worst = 0.0;
  Index at = 0;
  for (Index k = 0; k < record_.frequency_hz.size(); ++k) {
    const LineRecord& line = record_.lines[k];
    const double cond = condition(line.R(record_.axes, Eigen::all));
    if (cond <= worst) continue;
    worst = cond;
    at = k;
  }
  const auto axes = static_cast<Index>(record_.axes.size());
  if (record_.experiments() < axes)
    find(Severity::fault, Cause::excitation, "", "fewer experiments than excited axes",
         fmt::format("{} for {}",
                     counted(static_cast<std::size_t>(record_.experiments()), "experiment"),
                     counted(record_.axes.size(), "axis", "axes")),
         "use one experiment per axis, or an orthogonal scheme");
  else if (!std::isfinite(worst))
    find(Severity::fault, Cause::excitation, "", "some lines excite only some of the axes",
         fmt::format("at {:.4g} Hz", record_.frequency_hz[at]),
         "excite all axes on the same lines");
  else if (worst > kWorstExcitation)
    find(Severity::fault, Cause::excitation, "",
         "the experiments excite the axes almost identically",
         fmt::format("cond(R) {:.3g} at {:.4g} Hz", worst, record_.frequency_hz[at]),
         "use one experiment per axis, or an orthogonal scheme");
}

/// Called after the channels of the record are corrected.
void Examination::check_inputs() {
  const std::vector<Index> excited = excited_actuators();
  if (excited.empty() || record_.zippered) return;
  std::vector<Index> rows;
  for (const Index a : excited) rows.push_back(record_.n_y() + a);
  std::vector<double> conditions;
  const double last_hz = record_.frequency_hz[record_.frequency_hz.size() - 1];
  for (Index k = 0; k < record_.frequency_hz.size(); ++k)
    if (record_.frequency_hz[k] > 0.5 * last_hz)
      conditions.push_back(condition(record_.mean(record_.lines[k].Z(rows, Eigen::all))));
  if (conditions.empty()) return;
  const double median = order_statistic(conditions, 0.5);
  if (std::isfinite(median) &&
      median > kWorstInputs)  // otherwise an input has no power, which is reported already
    find(Severity::doubt, Cause::inputs, "", "the loop makes the inputs almost linearly dependent",
         fmt::format("median cond(U) {:.3g} above {:.4g} Hz", median, 0.5 * last_hz),
         "put more power into the weak directions: shape the excitation by the sensitivity");
}

void Examination::check_excluded() {
  const std::vector<Index> excited = excited_actuators();
  // An unrecorded drive of one axis moves the others through the loop too.
  if (excited.empty() || found(Cause::unrecorded)) return;
  const auto power = [&](Index a) {
    double sum = 0.0;
    for (const LineRecord& line : record_.lines)
      sum += record_.mean(line.Z.row(record_.n_y() + a)).squaredNorm();
    return sum;
  };
  double inputs = 0.0;
  for (const Index a : excited) inputs += power(a);
  if (!(inputs > 0.0)) return;
  // A mode averages the bias over lines and realizations, as it does the noise.
  const double averaged = static_cast<double>(record_.lines.size() * (1 + record_.others.size()));
  const double tolerable =
      record_.scatter_dof() > 0 ? noise_share(record_) / averaged : kExcludedPower;
  for (Index a = 0; a < record_.n_u(); ++a) {
    const Index c = record_.n_y() + a;
    if (std::ranges::find(excited, a) != excited.end()) continue;
    const double share = power(a) / inputs;
    if (share > tolerable && responds(record_, c))  // the bias is about the root of the share
      find(Severity::fault, Cause::excluded, name(c),
           "is not an input of the sub-plant but moves on the excited lines, which biases the "
           "response",
           fmt::format("{:.2g} of the power of the inputs", share),
           "excite it as well, or open its loop");
  }
}

/// The checks of one realization's recording.
void Examination::check_realization() {
  check_injection();
  check_responses();
  if (!any_fault(findings_)) check_arrival();
  check_excitation();
  check_recording();
  check_excluded();
}

/// Of a realization after the first one. @pre spoilt_ is that of the whole log
std::vector<Finding> Examination::examine_other() {
  if (const std::optional<ExcitationDelay> delay = align_excitation(record_, nominal_))
    findings_.push_back(to_finding(*delay));
  check_realization();
  std::erase_if(findings_, is_of_log);
  return std::move(findings_);
}

/// Whether u = r - C y holds; true if this is unknown.
bool Examination::follows_stage() {
  return !nominal_ || !spoilt_.empty() || !why_no_nominal(true).empty() ||
         follows_controller(record_, *nominal_);
}

/// Adds the findings of the other realizations to `own`, those of the first one. If that has none, only those are
/// examined whose response lies apart, or whose signals violate u = r - C y.
void Examination::add_others(std::vector<Finding>& own) {
  const auto& apart = record_.differences.outlying;
  const bool clean = own.empty();
  for (RealizationRecord& other : record_.others) {
    HealthRecord record;
    static_cast<RealizationRecord&>(record) = std::move(other);
    record.info = record_.info;
    record.scan = record_.scan;
    Examination examination(std::move(record), nominal_);
    examination.spoilt_ = spoilt_of_log_;
    const int realization = examination.record_.realization;
    if (clean && std::ranges::find(apart, realization) == apart.end() &&
        examination.follows_stage())
      continue;
    for (Finding& f : examination.examine_other()) {
      auto same = std::ranges::find_if(own, [&f](const Finding& one) {
        return one.cause == f.cause && one.channel == f.channel && one.severity == f.severity &&
               one.what == f.what;
      });
      if (same == own.end()) same = own.insert(own.end(), std::move(f));
      same->realizations.push_back(realization);
    }
  }
}

/// Merges the findings `own` of the first realization with those of the others: what only some have names them.
void Examination::check_others(std::vector<Finding> own) {
  const auto of_log = std::stable_partition(own.begin(), own.end(), std::not_fn(is_of_log));
  std::move(of_log, own.end(), std::back_inserter(findings_));
  own.erase(of_log, own.end());
  for (Finding& f : own) f.realizations = {record_.realization};
  add_others(own);
  const auto in_all = [this](const Finding& f) {
    return f.realizations.size() > record_.others.size();
  };
  // What the recording does not explain is a difference at the stage, or the stage is unknown.
  for (const RealizationChange& change : record_.differences.changes)
    if (std::ranges::none_of(own, [&](const Finding& f) {
          return f.severity == Severity::fault && !in_all(f) &&
                 std::ranges::find(f.realizations, change.realization) != f.realizations.end();
        }))
      findings_.push_back(to_finding(change));
  if (record_.differences.plant && std::ranges::all_of(own, [&](const Finding& f) {
        return f.severity != Severity::fault || in_all(f);
      }))
    findings_.push_back(to_finding(*record_.differences.plant));
  for (Finding& f : own) {
    if (in_all(f))
      f.realizations.clear();
    else
      f.what += fmt::format(", in {} only", named_realizations(f.realizations));
    findings_.push_back(std::move(f));
  }
}

std::vector<Finding> Examination::examine() {
  findings_ = check_timing(record_, nominal_);
  for (Finding& finding : to_findings(record_.steps, record_.info.actuators))
    findings_.push_back(std::move(finding));
  check_declared();
  check_cycles();
  check_samples();
  spoilt_of_log_ = spoilt_;
  if (!found(Cause::aperiodic)) {  // otherwise no spectrum is valid
    std::vector<Finding> of_log = std::move(findings_);
    findings_.clear();
    const auto late = std::ranges::find(of_log, Cause::excitation_timing, &Finding::cause);
    if (late != of_log.end()) {
      findings_.push_back(std::move(*late));
      of_log.erase(late);
    }
    check_realization();
    check_others(std::exchange(findings_, std::move(of_log)));
    check_stage();
    check_inputs();
    if (!any_fault(findings_))  // a stuck channel would look like a transient
      for (Finding& finding : check_start_transient(record_.start))
        if (!found(finding.cause)) findings_.push_back(std::move(finding));
  }
  std::ranges::stable_sort(findings_, {}, rank_of);
  return std::move(findings_);
}

std::vector<Finding> check_health(HealthRecord record, const std::optional<NominalStage>& nominal) {
  return Examination(std::move(record), nominal).examine();
}

}  // namespace stageid
