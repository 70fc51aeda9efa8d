#include "estimation/tracking/stage_change.hpp"

#include <fmt/format.h>

namespace stageid {

std::vector<PossibleChange> possible_changes(const AdditiveModel& model,
                                             const std::vector<TrackedParameter>& parameters,
                                             const Eigen::MatrixXd& information) {
  const Eigen::VectorXd largest = largest_changes(parameters, model.sample_rate_hz);
  const auto q = std::ssize(parameters);
  std::vector<PossibleChange> changes;
  Eigen::VectorXd frequencies = Eigen::VectorXd::Zero(q);
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(q);
  for (Eigen::Index p = 0; p < q; ++p) {
    if (information(p, p) * largest[p] * largest[p] < 1.0) continue;
    changes.push_back({ChangeKind::parameter, p, Eigen::VectorXd::Unit(q, p)});
    const TrackedKind kind = parameters[p].kind;
    if (kind == TrackedKind::frequency) frequencies[p] = 1.0;
    if (kind == TrackedKind::sensor_gain) gains[p] = 1.0;
  }
  if (frequencies.sum() > 1.0) changes.push_back({ChangeKind::all_frequencies, 0, frequencies});
  if (gains.sum() > 1.0) changes.push_back({ChangeKind::all_gains, 0, gains});
  for (Eigen::Index i = 0; i < model.n_outputs(); ++i)
    changes.push_back({ChangeKind::noise, i, {}});
  return changes;
}

bool is_of_gains(const PossibleChange& change, const std::vector<TrackedParameter>& parameters) {
  if (change.kind != ChangeKind::parameter) return change.kind == ChangeKind::all_gains;
  const TrackedKind kind = parameters[change.index].kind;
  return kind == TrackedKind::sensor_gain || kind == TrackedKind::actuator_gain;
}

std::string describe(const PossibleChange& change, const std::vector<TrackedParameter>& parameters,
                     const AdditiveModel& model) {
  switch (change.kind) {
    case ChangeKind::parameter:
      return describe(parameters[change.index], model);
    case ChangeKind::all_frequencies:
      return "frequencies of all modes";
    case ChangeKind::all_gains:
      return "gains of all sensors or of all actuators";
    case ChangeKind::motion:
      return "another motion";
    case ChangeKind::disturbance:
      return "disturbance that has passed";
    case ChangeKind::noise:
      break;
  }
  return fmt::format("noise of sensor '{}'", model.outputs.name(change.index));
}

}  // namespace stageid
