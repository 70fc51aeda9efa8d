#include "frf/data_health.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "excitation/counted.hpp"
#include "frf/controller_check.hpp"
#include "frf/health_measures.hpp"
#include "frf/order_statistic.hpp"
#include "frf/rigid_body_check.hpp"
#include "frf/skew_check.hpp"
#include "frf/timing_check.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kSignificance = 1e-4;    // of a check, over all channels
constexpr double kSuspicion = 0.05;       // of clipping, where u = r - C y fails
constexpr double kStuckShare = 0.02;      // of a run's samples that show one value
constexpr double kResponds = 1e-3;        // of the largest nominal response
constexpr double kExcludedPower = 1e-4;   // of the inputs' power
constexpr double kWorstExcitation = 1e3;  // cond(R)
constexpr double kWorstInputs = 1e2;      // median of cond(U) in the upper half of the band
constexpr double kLeastCoherence = 0.9;
constexpr double kLargestRigidDeviation = 0.3;

/// The checks of one log, in the order in which one rules out the next.
class Examination {
 public:
  Examination(HealthRecord&& record, const std::optional<NominalStage>& nominal)
      : record_(std::move(record)), nominal_(nominal) {}

  std::vector<Finding> examine();

 private:
  void check_cycles();
  void check_samples();
  void check_responses();
  void check_excitation();
  void check_recording();
  void check_stage();
  void check_inputs();
  void check_excluded();

  void find(Severity severity, Cause cause, std::string channel, std::string what,
            std::string figure, std::string remedy) {
    findings_.push_back({severity, cause, std::move(channel), std::move(what), std::move(figure),
                         std::move(remedy)});
  }
  const std::string& name(Index channel) const;  // of [sensors; actuators]
  bool spoilt(Index channel) const {
    return std::find(spoilt_.begin(), spoilt_.end(), channel) != spoilt_.end();
  }
  bool found(Cause cause) const;
  void find_clipped(Index channel, double log_p);
  bool find_suspected(Index first, Index count);
  std::vector<Index> excited_actuators() const;
  bool expected_to_respond(Index sensor, bool& known) const;
  std::string why_no_nominal(bool all_sensors) const;

  HealthRecord record_;
  const std::optional<NominalStage>& nominal_;
  std::vector<Finding> findings_;
  std::vector<Index> spoilt_;  // of [sensors; actuators]: dead or clipped
};

const std::string& Examination::name(Index channel) const {
  return channel < record_.n_y()
             ? record_.info.sensors.names[static_cast<std::size_t>(channel)]
             : record_.info.actuators.names[static_cast<std::size_t>(channel - record_.n_y())];
}

bool Examination::found(Cause cause) const {
  return std::any_of(findings_.begin(), findings_.end(),
                     [&](const Finding& f) { return f.cause == cause; });
}

std::vector<Index> Examination::excited_actuators() const {
  std::vector<Index> found;
  const auto& names = record_.info.actuators.names;
  for (const Index axis : record_.axes) {
    const auto at = std::find(names.begin(), names.end(),
                              record_.info.excitation.names[static_cast<std::size_t>(axis)]);
    if (at == names.end()) return {};
    found.push_back(at - names.begin());
  }
  return found;
}

void Examination::check_cycles() {
  const RunHealth& health = record_.health;
  if (health.marked + health.missing > 0)
    find(Severity::doubt, Cause::marked, "", "samples are marked as not to be used",
         fmt::format("{} of {} cycles", health.marked + health.missing, health.cycles),
         "their periods are left out; repeat the runs if there are many");
  if (health.late > 0)
    find(Severity::doubt, Cause::late, "", "cycles were late: the loop's phase is not the model's",
         fmt::format("{} of {}, the latest by {:.3g} us", health.late, health.cycles,
                     1e-3 * static_cast<double>(health.largest_lateness_ns)),
         "give the loop a core of its own (realtime: in the stage file)");
}

void Examination::check_samples() {
  const double limit = std::log(kSignificance / (2.0 * static_cast<double>(record_.scan.size())));
  const auto run_samples =
      static_cast<double>(record_.periods.empty() ? 1 : record_.periods.front()) *
      record_.info.period_samples;
  for (Index c = 0; c < static_cast<Index>(record_.scan.size()); ++c) {
    const ChannelScan& scan = record_.scan[static_cast<std::size_t>(c)];
    const bool sensor = c < record_.n_y();
    const auto stuck = static_cast<double>(scan.longest_constant());
    const bool piles_up = std::min(scan.log_p_high(), scan.log_p_low()) < limit;
    // An actuator that nothing drives stands still by right; a whole run of one value is no clipping.
    if (stuck > std::max(kStuckShare * run_samples, 2.0) && !(piles_up && scan.returns())) {
      bool known = false;
      const auto excited = excited_actuators();
      const bool driven =
          sensor ? expected_to_respond(c, known) || !known
                 : std::find(excited.begin(), excited.end(), c - record_.n_y()) != excited.end();
      if (!driven) continue;
      find(Severity::fault, Cause::dead, name(c), "dead: shows one value for long",
           fmt::format("{:.3g} s", stuck / record_.info.sample_rate_hz),
           "look at its cable and its amplifier; measure again");
      spoilt_.push_back(c);
      continue;
    }
    if (piles_up) find_clipped(c, limit);
  }
}

/// @param log_p from where on an end of the range tells of clipping
void Examination::find_clipped(Index c, double log_p) {
  const ChannelScan& scan = record_.scan[static_cast<std::size_t>(c)];
  const bool sensor = c < record_.n_y();
  const bool high = scan.log_p_high() <= log_p;
  const bool low = scan.log_p_low() <= log_p;
  const std::string& unit = (sensor ? record_.info.sensors : record_.info.actuators)
                                .units[static_cast<std::size_t>(sensor ? c : c - record_.n_y())];
  find(Severity::fault, Cause::saturated, name(c),
       "clipped: samples pile up at the end of its range",
       fmt::format("{} at {:.4g} {}",
                   counted((high ? scan.high().count : 0) + (low ? scan.low().count : 0), "sample"),
                   high ? scan.high().value : scan.low().value, unit),
       sensor ? "lower the level, or widen the sensor's range"
              : "lower the level, or raise the actuator's limit");
  spoilt_.push_back(c);
}

/// Where u = r - C y fails, a few samples that pile up are enough to say why: the channel most clipped
/// of `count` from `first` on.
bool Examination::find_suspected(Index first, Index count) {
  const auto log_p = [this](Index c) {
    const ChannelScan& scan = record_.scan[static_cast<std::size_t>(c)];
    return scan.log_p_high() + scan.log_p_low();
  };
  Index most = first;
  for (Index c = first; c < first + count; ++c)
    if (log_p(c) < log_p(most)) most = c;
  if (log_p(most) > std::log(kSuspicion)) return false;
  find_clipped(most, 0.5 * std::log(kSuspicion));
  return true;
}

/// Whether the rigid body moves this sensor when the excited actuators push.
bool Examination::expected_to_respond(Index sensor, bool& known) const {
  std::string missing;
  known = false;
  if (!nominal_ || record_.frequency_hz.size() == 0) return false;
  const auto y = positions_in(nominal_->sensors, record_.info.sensors.names, missing);
  const auto u = positions_in(nominal_->actuators, record_.info.actuators.names, missing);
  const std::vector<Index> excited = excited_actuators();
  if (y.empty() || u.empty() || excited.empty()) return false;
  known = true;
  const Eigen::MatrixXcd G =
      nominal_->rigid_body(record_.frequency_hz[record_.frequency_hz.size() / 2]);
  double here = 0.0;
  for (const Index a : excited)
    here = std::max(
        here, std::abs(G(y[static_cast<std::size_t>(sensor)], u[static_cast<std::size_t>(a)])));
  return here > kResponds * G.cwiseAbs().maxCoeff();
}

void Examination::check_responses() {
  for (Index s = 0; s < record_.n_y(); ++s) {
    if (spoilt(s)) continue;
    bool known = false;
    const bool expected = expected_to_respond(s, known);
    if (!responds(record_, s)) {
      if (known && !expected) continue;
      find(known ? Severity::fault : Severity::doubt, Cause::dead, name(s),
           known ? "dead: noise only, where the rigid body moves it"
                 : "no response to the excitation: dead, or it does not see these axes",
           "no line above its noise",
           known ? "look at its cable and its supply; measure again"
                 : "leave it out with --outputs, or look at its cable");
      spoilt_.push_back(s);
      continue;
    }
    const double coherence = median_coherence(record_, s);
    // A dead sensor in the loop disturbs the others.
    if (expected && spoilt_.empty() && coherence < kLeastCoherence)
      find(Severity::doubt, Cause::incoherent, name(s),
           "little of its motion repeats from period to period",
           fmt::format("median coherence {:.2f}", coherence),
           "raise the level, or measure more periods");
  }
}

void Examination::check_excitation() {
  if (record_.axes.empty() || record_.zippered) return;  // orthogonal: they share no line
  double worst = 0.0;
  Index at = 0;
  for (Index k = 0; k < record_.frequency_hz.size(); ++k) {
    const LineRecord& line = record_.lines[static_cast<std::size_t>(k)];
    const double cond = condition(line.R(record_.axes, Eigen::all));
    if (cond <= worst) continue;
    worst = cond;
    at = k;
  }
  if (record_.experiments() < static_cast<Index>(record_.axes.size()) || worst > kWorstExcitation)
    find(Severity::fault, Cause::excitation, "", "the experiments excite the axes almost alike",
         fmt::format("cond(R) {:.3g} at {:.4g} Hz", worst, record_.frequency_hz[at]),
         "one experiment an axis, or an orthogonal scheme");
}

/// After the recording's channels are put right.
void Examination::check_inputs() {
  const std::vector<Index> excited = excited_actuators();
  if (excited.empty() || record_.zippered) return;
  std::vector<Index> rows;
  for (const Index a : excited) rows.push_back(record_.n_y() + a);
  std::vector<double> conditions;
  const double last_hz = record_.frequency_hz[record_.frequency_hz.size() - 1];
  for (Index k = 0; k < record_.frequency_hz.size(); ++k)
    if (record_.frequency_hz[k] > 0.5 * last_hz)
      conditions.push_back(
          condition(record_.mean(record_.lines[static_cast<std::size_t>(k)].Z(rows, Eigen::all))));
  if (conditions.empty()) return;
  const double median = order_statistic(conditions, 0.5);
  if (median > kWorstInputs)
    find(Severity::doubt, Cause::inputs, "", "the loop makes the inputs almost alike",
         fmt::format("median cond(U) {:.3g} above {:.4g} Hz", median, 0.5 * last_hz),
         "more power on the weak directions; shape the excitation by the sensitivity");
}

std::string Examination::why_no_nominal(bool all_sensors) const {
  if (!nominal_) return "the stage's configuration: --stage STAGE.yaml";
  if (excited_actuators().empty())
    return "an excitation that is added at the actuators, under their names";
  std::string missing;
  if (positions_in(nominal_->actuators, record_.info.actuators.names, missing).empty() ||
      positions_in(nominal_->sensors, record_.info.sensors.names, missing).empty())
    return fmt::format("a stage file that knows channel {}", missing);
  if (all_sensors && positions_in(record_.info.sensors.names, nominal_->sensors, missing).empty())
    return fmt::format("the record of sensor {}, which the controller sees", missing);
  return "";
}

void Examination::check_recording() {
  const char* what = "names, signs, scales and timing of the recorded channels (u = r - C y)";
  if (const std::string why = why_no_nominal(true); !why.empty()) {
    find(Severity::unchecked, Cause::controller, "", what, "", "needs " + why);
    return;
  }
  if (!spoilt_.empty()) {
    find(Severity::unchecked, Cause::controller, "", what, "",
         fmt::format("needs channel {} in order", name(spoilt_.front())));
    return;
  }
  const ControllerCheck check = check_controller(record_, *nominal_);
  for (const ChannelChange& change : check.changes)
    findings_.push_back(to_finding(change, record_.info, true));
  if (!check.misfits.empty() && check.misfits.front().of_all) {
    if (find_suspected(0, record_.n_y())) return;
    find(Severity::doubt, Cause::controller, "",
         "the loop was closed by another controller than the configuration's",
         fmt::format("u - r + C y is {:.2g} of C y", check.misfits.front().relative),
         "give the stage file of this log: --stage");
    return;
  }
  for (const ControllerMisfit& misfit : check.misfits) {
    if (find_suspected(record_.n_y() + misfit.actuator, 1)) continue;
    const std::vector<Index> excited = excited_actuators();
    const bool is_input =
        std::find(excited.begin(), excited.end(), misfit.actuator) != excited.end();
    find(Severity::fault, Cause::unrecorded, name(record_.n_y() + misfit.actuator),
         is_input ? "moves by more than r - C y: an excitation that was not recorded"
                  : "moves by itself beside the sub-plant: it is excited and that was not recorded",
         fmt::format("u - r + C y is {:.2g} of C y", misfit.relative),
         "switch off what drives it, or record it as excitation");
  }
  if (record_.scatter_dof() == 0)
    find(Severity::unchecked, Cause::skew, "", "timing skew of the recorded channels", "",
         "needs two periods a run");
}

void Examination::check_stage() {
  const char* what = "wiring behind the recording (rigid body against geometry and mass)";
  const std::string why = why_no_nominal(false);
  std::vector<Index> outputs;
  if (why.empty()) {
    for (Index s = 0; s < record_.n_y(); ++s) {
      bool known = false;
      if (!spoilt(s) && expected_to_respond(s, known)) outputs.push_back(s);
    }
  }
  const std::vector<Index> inputs = excited_actuators();
  if (!why.empty() || outputs.empty()) {
    find(Severity::unchecked, Cause::rigid_body, "", what, "",
         "needs " + (why.empty() ? std::string("a sensor that sees the excited axes") : why));
    return;
  }
  for (const Index a : inputs)
    if (spoilt(record_.n_y() + a)) return;
  if (found(Cause::excluded)) {
    find(Severity::unchecked, Cause::rigid_body, "", what, "",
         "needs every actuator that moves excited: Y U^-1 is not the plant without");
    return;
  }
  if (record_.zippered) {
    find(Severity::unchecked, Cause::rigid_body, "", what, "",
         "needs all axes on one line: a scheme other than zippered");
    return;
  }
  const std::vector<PlantLine> lines = plant_lines(record_, *nominal_, outputs, inputs);
  const RigidBodyCheck check = check_rigid_body(lines, outputs, inputs);
  if (!check.unchecked.empty()) {
    find(Severity::unchecked, Cause::rigid_body, "", what, "", "there are " + check.unchecked);
    return;
  }
  for (const Index a : check.dead_actuators)
    find(Severity::fault, Cause::dead, name(record_.n_y() + a), "dead: its force moves nothing",
         "less than 5 % of the rigid body's motion", "look at its amplifier and its cable");
  for (const ChannelChange& change : check.changes)
    findings_.push_back(to_finding(change, record_.info, false));
  if (check.deviation > kLargestRigidDeviation)
    find(Severity::doubt, Cause::rigid_body, "", "the rigid body is not that of the configuration",
         fmt::format("{:.0f} % off, {:.3g} ... {:.3g} Hz", 100.0 * check.deviation,
                     check.band_hz[0], check.band_hz[1]),
         "correct mass, inertia or positions in the stage file");
  if (!check.dead_actuators.empty()) return;  // noise has no phase
  const SkewCheck skew = check_skew(lines, outputs, inputs);
  for (const ChannelChange& change : skew.changes)
    findings_.push_back(to_finding(change, record_.info, false));
  if (!skew.unchecked.empty())
    find(Severity::unchecked, Cause::skew, "", "timing skew behind the recording", "",
         "needs " + skew.unchecked + "; fit --delay per_channel estimates it");
}

void Examination::check_excluded() {
  const std::vector<Index> excited = excited_actuators();
  // Where something drives an axis unseen the loop moves the others too.
  if (excited.empty() || found(Cause::unrecorded)) return;
  const auto power = [&](Index a) {
    double sum = 0.0;
    for (const LineRecord& line : record_.lines)
      sum += record_.mean(line.Z.row(record_.n_y() + a)).squaredNorm();
    return sum;
  };
  double inputs = 0.0;
  for (const Index a : excited) inputs += power(a);
  for (Index a = 0; a < record_.n_u(); ++a) {
    const Index c = record_.n_y() + a;
    if (std::find(excited.begin(), excited.end(), a) != excited.end()) continue;
    const double share = power(a) / inputs;
    if (share > kExcludedPower && responds(record_, c))
      find(Severity::doubt, Cause::excluded, name(c),
           "is not part of the sub-plant but moves on the excited lines: it biases the response",
           fmt::format("{:.2g} of the inputs' power", share), "excite it too, or open its loop");
  }
}

std::vector<Finding> Examination::examine() {
  findings_ = check_timing(record_, nominal_);
  check_cycles();
  check_samples();
  if (!found(Cause::aperiodic)) {  // else no spectrum is what it seems
    check_responses();
    check_excitation();
    check_recording();
    check_excluded();
    check_stage();
    check_inputs();
  }
  std::stable_sort(findings_.begin(), findings_.end(),
                   [](const Finding& a, const Finding& b) { return a.severity < b.severity; });
  return std::move(findings_);
}

}  // namespace

std::vector<Finding> check_health(HealthRecord record, const std::optional<NominalStage>& nominal) {
  return Examination(std::move(record), nominal).examine();
}

}  // namespace stageid
