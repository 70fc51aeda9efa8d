#include "tools/watch/watch_event.hpp"

#include <fmt/format.h>

#include <cmath>

#include "tools/terminal/console.hpp"

namespace stageid {
namespace {

/// Below this probability another cause is named too.
constexpr double kSure = 0.95;

const TrackedParameter* parameter_of(const PossibleChange& change, const ModelTracker& tracker) {
  return change.kind == ChangeKind::parameter ? &tracker.parameters()[change.index] : nullptr;
}

bool is_channel_gain(const TrackedParameter* parameter) {
  return parameter != nullptr && (parameter->kind == TrackedKind::sensor_gain ||
                                  parameter->kind == TrackedKind::actuator_gain);
}

/// "-0.0031 % +- 0.0004 %", in microseconds for a delay
std::string size_text(const TrackedParameter* parameter, double size, double deviation) {
  if (parameter != nullptr && parameter->kind == TrackedKind::delay)
    return fmt::format("{:+.4g} us +- {:.2g} us", 1e6 * size, 1e6 * deviation);
  return fmt::format("{:+.4g} % +- {:.2g} %", 100.0 * size, 100.0 * deviation);
}

const char* remedy_of(const StageChange& change, const TrackedParameter* parameter) {
  switch (change.what.kind) {
    case ChangeKind::all_frequencies:
      return "Check the temperature and the load of the stage";
    case ChangeKind::all_gains:
      return "Check what all sensors or all amplifiers have in common: supply, reference, scale";
    case ChangeKind::noise:
      return "Check the cable, the ground and the light or target of this sensor";
    case ChangeKind::motion:
      return "The stage is learned again beside this motion; nothing has to be done";
    case ChangeKind::disturbance:
      return "Nothing has to be done unless it comes again";
    case ChangeKind::parameter:
      break;
  }
  switch (parameter->kind) {
    case TrackedKind::frequency:
    case TrackedKind::damping:
      return "Check bolts, cables and dampers where this mode moves; if the change is wanted, "
             "identify the stage again";
    case TrackedKind::sensor_gain:
      return "Check the calibration, the cable and the target of this sensor";
    case TrackedKind::actuator_gain:
      return "Check the amplifier, the cable and the coil of this actuator";
    case TrackedKind::delay:
      break;
  }
  return "Check the sample time and the software of controller and link";
}

std::string what_happened(const StageChange& change, const ModelTracker& tracker,
                          const AdditiveModel& model) {
  const TrackedParameter* parameter = parameter_of(change.what, tracker);
  std::string name = describe(change.what, tracker.parameters(), model);
  if (!is_of_stage(change.what.kind)) return name;
  // Gains near 0 or below are faults of their own.
  if (is_channel_gain(parameter)) {
    const double gain = 1.0 + change.size;
    if (std::abs(gain) < std::max(0.02, 3.0 * change.deviation)) return name + " is zero: dead";
    if (gain < 0.0)
      return fmt::format("{} is {:.3g} times that of the model: its sign is reversed", name, gain);
  }
  return fmt::format("{} changed by {}", name, size_text(parameter, change.size, change.deviation));
}

/// One sentence and a remedy. @param since_s in recorded time
std::string change_text(const StageChange& change, const ModelTracker& tracker,
                        const AdditiveModel& model, double since_s) {
  std::string text =
      fmt::format("{}, since {:.6g} s, probability {:.3g}", what_happened(change, tracker, model),
                  since_s, change.probability);
  if (change.probability < kSure && change.otherwise)
    text +=
        fmt::format("; else {} ({:.2g})", describe(*change.otherwise, tracker.parameters(), model),
                    change.other_probability);
  return text + ". " + remedy_of(change, parameter_of(change.what, tracker));
}

}  // namespace

Json change_json(const StageChange& change, const ModelTracker& tracker, const AdditiveModel& model,
                 const WatchedPeriod& period, double period_s) {
  const TrackedParameter* parameter = parameter_of(change.what, tracker);
  const double since_s = period.time_s - (change.periods + 1) * period_s;
  Json json = {
      {"event", "change"},
      {"kind", parameter != nullptr ? to_string(parameter->kind) : to_string(change.what.kind)},
      {"name", describe(change.what, tracker.parameters(), model)},
      {"time_s", period.time_s},
      {"run", period.run},
      {"period", period.period},
      {"since_s", since_s},
      {"size", change.size},
      {"deviation", change.deviation},
      {"probability", change.probability},
      {"statistic", change.statistic}};
  if (parameter != nullptr &&
      (parameter->kind == TrackedKind::frequency || parameter->kind == TrackedKind::damping))
    json["mode_hz"] = model.submodels[parameter->index].natural_frequency_hz();
  if (parameter != nullptr && parameter->kind == TrackedKind::actuator_gain)
    json["channel"] = model.inputs.name(parameter->index);
  if (parameter != nullptr && parameter->kind == TrackedKind::sensor_gain)
    json["channel"] = model.outputs.name(parameter->index);
  if (change.what.kind == ChangeKind::noise)
    json["channel"] = model.outputs.name(change.what.index);
  if (change.otherwise) {
    json["otherwise"] = describe(*change.otherwise, tracker.parameters(), model);
    json["other_probability"] = change.other_probability;
  }
  json["text"] = change_text(change, tracker, model, since_s);
  return json;
}

Json tracked_json(const ModelTracker& tracker, const AdditiveModel& model) {
  const Eigen::VectorXd deviation = tracker.covariance().diagonal().cwiseSqrt();
  Json json = Json::array();
  for (Eigen::Index p = 0; p < deviation.size(); ++p) {
    const TrackedParameter& parameter = tracker.parameters()[p];
    json.push_back({{"kind", to_string(parameter.kind)},
                    {"name", describe(parameter, model)},
                    {"change", tracker.estimate()[p]},
                    {"deviation", deviation[p]}});
  }
  return json;
}

std::vector<std::string> tracked_lines(const ModelTracker& tracker, const AdditiveModel& model) {
  const Eigen::VectorXd deviation = tracker.covariance().diagonal().cwiseSqrt();
  std::vector<std::vector<std::string>> rows = {
      {"tracked", "change from the model (+- without its error)"}};
  for (Eigen::Index p = 0; p < deviation.size(); ++p) {
    const TrackedParameter& parameter = tracker.parameters()[p];
    rows.push_back(
        {describe(parameter, model), size_text(&parameter, tracker.estimate()[p], deviation[p])});
  }
  return table_lines(rows);
}

}  // namespace stageid
