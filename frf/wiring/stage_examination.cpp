// Checks that need the stage: the recorded signals against its controller, the plant against its rigid body.
#include <fmt/format.h>

#include <algorithm>

#include "frf/wiring/examination.hpp"
#include "frf/wiring/feedback_check.hpp"
#include "frf/wiring/recorded_channels_check.hpp"
#include "frf/wiring/skew_check.hpp"
#include "frf/wiring/stage_wiring_check.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kResponds = 1e-3;  // of the largest nominal response
constexpr double kSameRate = 1e-4;  // relative; clocks of recorders differ by less
constexpr double kFedBack = 1e-4;   // of an actuator: ten times the limit of equality

}  // namespace

/// Whether the excited actuators move this sensor through the rigid body; none if this is unknown.
std::optional<bool> Examination::expected_to_respond(Index sensor) const {
  if (!nominal_ || !nominal_->rigid_body || record_.frequency_hz.size() == 0) return std::nullopt;
  const auto y = positions_in(nominal_->sensors, record_.info.sensors.names);
  const auto u = positions_in(nominal_->actuators, record_.info.actuators.names);
  const std::vector<Index> excited = excited_actuators();
  if (y.empty() || u.empty() || excited.empty()) return std::nullopt;
  const Eigen::MatrixXcd G =
      nominal_->rigid_body(record_.frequency_hz[record_.frequency_hz.size() / 2]);
  double here = 0.0;
  for (const Index a : excited) here = std::max(here, std::abs(G(y[sensor], u[a])));
  return here > kResponds * G.cwiseAbs().maxCoeff();
}

/// How sample rate or units of the log differ from those of the stage file; empty: they are equal or unknown.
std::string Examination::difference_of_stage() const {
  if (!nominal_) return "";
  const double rate_hz = record_.info.sample_rate_hz;
  if (nominal_->sample_rate_hz > 0.0 &&
      std::abs(rate_hz / nominal_->sample_rate_hz - 1.0) > kSameRate)
    return fmt::format("a sample rate of {:.8g} Hz in the log, {:.8g} Hz in the stage file",
                       rate_hz, nominal_->sample_rate_hz);
  const auto differing = [](const ChannelList& logged, const std::vector<std::string>& names,
                            const std::vector<std::string>& units) -> std::string {
    for (std::size_t i = 0; i < units.size(); ++i) {
      const auto at = std::ranges::find(logged.names, names[i]) - logged.names.begin();
      if (at == std::ssize(logged.names) || logged.unit(at).empty() || logged.unit(at) == units[i])
        continue;
      return fmt::format("{} in {} in the log, in {} in the stage file", names[i], logged.unit(at),
                         units[i]);
    }
    return "";
  };
  const std::string sensor =
      differing(record_.info.sensors, nominal_->sensors, nominal_->sensor_units);
  return sensor.empty()
             ? differing(record_.info.actuators, nominal_->actuators, nominal_->actuator_units)
             : sensor;
}

void Examination::check_declared() {
  const std::string difference = difference_of_stage();
  if (difference.empty()) return;
  find(Severity::fault, Cause::controller, "", "the log does not belong to the stage file",
       difference, "correct what the log declares, or give the stage file of this log: --stage");
}

std::string Examination::why_no_nominal(bool all_sensors) const {
  if (!difference_of_stage().empty()) return "the sample rate and the units of the stage file";
  if (excited_actuators().empty()) return kNamedExcitation;
  std::string missing;
  if (positions_in(nominal_->actuators, record_.info.actuators.names, &missing).empty() ||
      positions_in(nominal_->sensors, record_.info.sensors.names, &missing).empty())
    return fmt::format("a stage file that contains channel {}", missing);
  if (all_sensors && positions_in(record_.info.sensors.names, nominal_->sensors, &missing).empty())
    return fmt::format("the record of sensor {}, which the controller uses", missing);
  return "";
}

/// An actuator that equals the excitation contains no information about the loop. The controller or the other actuators
/// show whether there is a loop.
void Examination::check_injection() {
  const std::vector<MappedExcitation> mapped = find_mapped_excitation(record_);
  const auto all = static_cast<std::size_t>(
      std::count_if(record_.scan.begin() + record_.n_y(), record_.scan.end(),
                    [](const ChannelScan& scan) { return scan.high().value != scan.low().value; }));
  for (const MappedExcitation& m : mapped) {
    const std::optional<bool> fed_back = controlled(m.actuator);
    if (fed_back == false) continue;  // its loop is open
    const std::string& excitation = record_.info.excitation.name(m.excitation);
    const std::string figure = std::abs(m.factor - 1.0) < 1e-5
                                   ? std::string("identical")
                                   : fmt::format("factor {:.6g}", m.factor);
    const bool may_be_open = !fed_back && mapped.size() >= all;
    find(Severity::fault, Cause::injection, name(record_.n_y() + m.actuator),
         fmt::format("equals the excitation {}: it contains no feedback", excitation), figure,
         may_be_open ? "in a closed loop, map the plant input (after the summation point); if the "
                       "loop is open, say so with a controller file: --stage FILE"
                     : "map the plant input (after the summation point)");
    spoilt_.push_back(record_.n_y() + m.actuator);
  }
}

/// Whether the controller's contribution to this actuator is measurable beside the excitation; none if this is unknown.
std::optional<bool> Examination::controlled(Index actuator) const {
  if (!nominal_ || !nominal_->controller || !why_no_nominal(false).empty()) return std::nullopt;
  const auto u = positions_in(nominal_->actuators, record_.info.actuators.names);
  const auto y = positions_in(nominal_->sensors, record_.info.sensors.names);
  double fed_back = 0.0;
  double moved = 0.0;
  for (std::size_t k = 0; k < record_.lines.size(); ++k) {
    const double frequency_hz = record_.frequency_hz[k];
    if (frequency_hz < nominal_->controller_from_hz || frequency_hz > nominal_->controller_to_hz)
      continue;
    const Eigen::MatrixXcd F = nominal_->controller(frequency_hz);
    const Eigen::MatrixXcd& Z = record_.lines[k].Z;
    fed_back += (F(u, y).row(actuator) * Z.topRows(record_.n_y())).squaredNorm();
    moved += Z.row(record_.n_y() + actuator).squaredNorm();
  }
  return fed_back > kFedBack * kFedBack * moved;
}

/// Reports, before all else, what this log cannot show, the missing file, and the results from the data alone.
void Examination::check_without_stage() {
  const FeedbackCheck check = check_feedback(record_);
  const bool tells = check.unchecked.empty() && spoilt_.empty();
  find(Severity::unchecked, Cause::unknown_stage, "",
       "names, signs, scales, timing and wiring of the channels: the stage of this log is unknown",
       tells ? fmt::format("u - r is linear in y to {:.1g} over {} experiments", check.relative,
                           check.experiments)
             : "",
       "--stage FILE: a stage file, or a controller file to check only the recording");
  if (!tells || check.inconsistent.empty()) return;
  const bool one = check.inconsistent.size() == 1;
  find(Severity::doubt, Cause::controller,
       one ? name(record_.n_y() + check.inconsistent.front()) : "",
       "u - r is not one linear function of the recorded sensors in all experiments",
       fmt::format("{:.2g} of u - r is unexplained", check.worst),
       "record all inputs and outputs of the controller, and keep it the same in all experiments");
}

void Examination::check_recording() {
  if (!nominal_) {
    check_without_stage();
    return;
  }
  const char* what = "names, signs, scales and timing of the recorded channels (u = r - C y)";
  if (const std::string why = why_no_nominal(true); !why.empty()) {
    find_unchecked(Cause::controller, what, "needs " + why);
    return;
  }
  if (!nominal_->controller) {
    find_unchecked(Cause::controller, what,
                   "needs the controller, which belongs to the stage ('controller: peer'): "
                   "--stage FILE with a controller file");
    return;
  }
  if (!spoilt_.empty()) {
    find_unchecked(Cause::controller, what,
                   fmt::format("needs channel {} without faults", name(spoilt_.front())));
    return;
  }
  const RecordedChannelsCheck check = check_recorded_channels(record_, *nominal_);
  for (const ChannelError& error : check.errors)
    findings_.push_back(to_finding(error, record_.info, true));
  if (!check.misfits.empty() && check.misfits.front().of_all) {
    if (find_suspected(0, record_.n_y())) return;
    find(Severity::doubt, Cause::controller, "",
         "the loop was closed by a different controller than the configured one, or a setpoint "
         "moved",
         fmt::format("u - r + C y is {:.2g} of C y", check.misfits.front().relative),
         "give the stage file of this log: --stage");
    return;
  }
  for (const ControllerMisfit& misfit : check.misfits) {
    if (find_suspected(record_.n_y() + misfit.actuator, 1)) continue;
    const std::vector<Index> excited = excited_actuators();
    const bool is_input = std::ranges::find(excited, misfit.actuator) != excited.end();
    find(Severity::fault, Cause::unrecorded, name(record_.n_y() + misfit.actuator),
         is_input ? "moves more than r - C y: an excitation, or a moving setpoint, was not recorded"
                  : "moves independently of the sub-plant: its excitation was not recorded",
         fmt::format("u - r + C y is {:.2g} of {}", misfit.relative,
                     misfit.controlled ? "C y" : "u; C y is zero"),
         "switch off the source that drives it, or record it as excitation");
  }
  if (record_.scatter_dof() == 0)
    find_unchecked(Cause::skew, "timing skew of the recorded channels",
                   "needs two periods per run");
}

void Examination::check_stage() {
  const char* what = "wiring between recorder and stage (rigid body against geometry and mass)";
  if (!nominal_) return;  // reported already
  const auto needs = [&](const std::string& missing) {
    find_unchecked(Cause::rigid_body, what, "needs " + missing);
  };
  if (const std::string why = why_no_nominal(false); !why.empty()) return needs(why);
  if (!nominal_->rigid_body)
    return needs("geometry and mass: a stage file, or 'stage: FILE' in the controller file");
  std::vector<Index> outputs;
  for (Index s = 0; s < record_.n_y(); ++s)
    if (!spoilt(s) && expected_to_respond(s).value_or(false)) outputs.push_back(s);
  if (outputs.empty()) return needs("a sensor that responds to the excited axes");
  const std::vector<Index> inputs = excited_actuators();
  for (const Index a : inputs)
    if (spoilt(record_.n_y() + a)) return;
  if (found(Cause::excluded))
    return needs(
        "an excitation of every actuator that moves; otherwise Y U^-1 differs from the plant");
  if (record_.zippered)
    return needs("all axes excited on the same lines; use a scheme other than zippered");
  const std::vector<PlantLine> lines = plant_lines(record_, *nominal_, outputs, inputs);
  const StageWiringCheck check = check_stage_wiring(lines, outputs, inputs);
  if (!check.unchecked.empty()) {
    find_unchecked(Cause::rigid_body, what, "there are " + check.unchecked);
    return;
  }
  for (const Index a : check.dead_actuators)
    find(Severity::fault, Cause::dead, name(record_.n_y() + a), "dead: its force has no effect",
         "less than 5 % of the motion of the rigid body", "check its amplifier and cable");
  for (const ChannelError& error : check.errors)
    findings_.push_back(to_finding(error, record_.info, false));
  if (check.deviation > kLargestRigidDeviation)
    find(Severity::doubt, Cause::rigid_body, "", "the rigid body differs from the configuration",
         fmt::format("by {:.0f} %, {:.3g} ... {:.3g} Hz", 100.0 * check.deviation, check.band_hz[0],
                     check.band_hz[1]),
         "correct mass, inertia or positions in the stage file");
  if (!check.dead_actuators.empty()) return;  // the phase of noise is meaningless
  const SkewCheck skew = check_skew(lines, outputs, inputs);
  for (const ChannelError& error : skew.errors)
    findings_.push_back(to_finding(error, record_.info, false));
  if (!skew.unchecked.empty())
    find_unchecked(Cause::skew, "timing skew between recorder and stage",
                   "needs " + skew.unchecked + "; fit --delay per_channel estimates it");
}

}  // namespace stageid
