#include "estimation/tracking/tracked_parameters.hpp"

#include <fmt/format.h>

namespace stageid {

std::vector<TrackedParameter> tracked_parameters(const AdditiveModel& model,
                                                 const std::array<double, 2>& band_hz) {
  std::vector<TrackedParameter> tracked;
  for (const TrackedKind kind : {TrackedKind::frequency, TrackedKind::damping})
    for (std::size_t i = 0; i < model.submodels.size(); ++i) {
      const Submodel& mode = model.submodels[i];
      if (!mode.is_mode() ||
          mode.verdict.value_or(ModeVerdict::determined) != ModeVerdict::determined)
        continue;
      const double frequency_hz = mode.natural_frequency_hz();
      if (frequency_hz >= band_hz[0] && frequency_hz <= band_hz[1])
        tracked.push_back({kind, static_cast<Eigen::Index>(i)});
    }
  for (Eigen::Index i = 0; i < model.n_outputs(); ++i)
    tracked.push_back({TrackedKind::sensor_gain, i});
  for (Eigen::Index j = 0; j < model.n_inputs(); ++j)
    tracked.push_back({TrackedKind::actuator_gain, j});
  tracked.push_back({TrackedKind::delay, 0});
  return tracked;
}

std::string describe(const TrackedParameter& parameter, const AdditiveModel& model) {
  const auto mode = [&] {
    return fmt::format(
        "of the mode at {:.6g} Hz",
        model.submodels[static_cast<std::size_t>(parameter.index)].natural_frequency_hz());
  };
  switch (parameter.kind) {
    case TrackedKind::frequency:
      return "frequency " + mode();
    case TrackedKind::damping:
      return "damping ratio " + mode();
    case TrackedKind::sensor_gain:
      return fmt::format("gain of sensor '{}'", model.outputs.name(parameter.index));
    case TrackedKind::actuator_gain:
      return fmt::format("gain of actuator '{}'", model.inputs.name(parameter.index));
    case TrackedKind::delay:
      break;
  }
  return "delay";
}

double nominal_value(const TrackedParameter& parameter, const AdditiveModel& model) {
  const auto mode = [&]() -> const Submodel& {
    return model.submodels[static_cast<std::size_t>(parameter.index)];
  };
  if (parameter.kind == TrackedKind::frequency) return mode().natural_frequency_hz();
  if (parameter.kind == TrackedKind::damping) return mode().damping_ratio();
  return parameter.kind == TrackedKind::delay ? 0.0 : 1.0;
}

Eigen::VectorXd largest_changes(const std::vector<TrackedParameter>& parameters,
                                double sample_rate_hz) {
  constexpr double kByKind[] = {0.05, 0.5, 0.3, 0.3, 1.0};  // of a delay: samples
  Eigen::VectorXd changes(std::ssize(parameters));
  for (Eigen::Index p = 0; p < changes.size(); ++p) {
    const TrackedKind kind = parameters[static_cast<std::size_t>(p)].kind;
    changes[p] = kByKind[static_cast<std::size_t>(kind)];
    if (kind == TrackedKind::delay) changes[p] /= sample_rate_hz;
  }
  return changes;
}

Eigen::MatrixXd prior_information(const std::vector<TrackedParameter>& parameters,
                                  double sample_rate_hz) {
  const Eigen::VectorXd changes = largest_changes(parameters, sample_rate_hz);
  Eigen::MatrixXd prior = changes.array().square().inverse().matrix().asDiagonal();
  Eigen::VectorXd common = Eigen::VectorXd::Zero(changes.size());
  for (Eigen::Index p = 0; p < common.size(); ++p) {
    const TrackedKind kind = parameters[static_cast<std::size_t>(p)].kind;
    if (kind == TrackedKind::sensor_gain) common[p] = 1.0;
    if (kind == TrackedKind::actuator_gain) common[p] = -1.0;
  }
  constexpr double kHeld = 1e12;  // a deviation of 1e-6
  return prior + kHeld / common.squaredNorm() * common * common.transpose();
}

Submodel moved(const Submodel& mode, double frequency, double damping) {
  Submodel out = mode;
  const double period = 1.0 / (1.0 + frequency);
  out.denominator[1] *= (1.0 + damping) * period;
  out.denominator[2] *= period * period;
  for (Eigen::MatrixXd& numerator : out.numerator) numerator *= period * period;
  return out;
}

}  // namespace stageid
