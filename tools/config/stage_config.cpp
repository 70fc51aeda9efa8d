#include "tools/config/stage_config.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "hal/simulator/fault_script.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/limits.hpp"
#include "tools/config/loop_controller.hpp"
#include "tools/config/stage_keys.hpp"
#include "tools/config/yaml_document.hpp"

namespace stageid {
namespace {

constexpr const char* kPeer = "peer";

/// @param value a member of ChannelConfig, or a function of it
template <typename Value>
Eigen::VectorXd per_channel(const std::vector<ChannelConfig>& channels, Value value) {
  Eigen::VectorXd values(std::ssize(channels));
  std::ranges::transform(channels, values.data(), value);
  return values;
}

Eigen::VectorXd limit_vector(const std::vector<ChannelConfig>& channels,
                             double ChannelConfig::*limit) {
  Eigen::VectorXd values = per_channel(channels, limit);
  return values.array().isInf().all() ? Eigen::VectorXd() : values;
}

std::vector<Channel> channels_of(const std::vector<ChannelConfig>& configs) {
  std::vector<Channel> channels;
  for (const ChannelConfig& config : configs) channels.push_back(config.channel);
  return channels;
}

int require_channel(const StageConfig& config, const std::vector<Channel>& channels,
                    const std::string& name, const char* kind, const char* place) {
  const int index = channel_index(channels, name);
  if (index < 0)
    fail_format(config.file, "", "{}: unknown {} '{}'; use one of the names in this file", place,
                kind, name);
  return index;
}

Eigen::VectorXd shape_vector(const StageConfig& config, const std::vector<Channel>& channels,
                             const std::vector<std::pair<std::string, double>>& values,
                             const char* kind) {
  Eigen::VectorXd shape = Eigen::VectorXd::Zero(std::ssize(channels));
  for (const auto& [name, value] : values)
    shape[require_channel(config, channels, name, kind, "in_plane_modes")] = value;
  return shape;
}

void take_limits(const StageFile& file, StageLimits& limits) {
  limits.actuator_n = limit_vector(file.actuators, &ChannelConfig::limit_n);
  limits.slew_n_s = limit_vector(file.actuators, &ChannelConfig::slew_n_s);
  limits.thermal_rms_n = limit_vector(file.actuators, &ChannelConfig::thermal_rms_n);
  limits.position_window_m = limit_vector(file.sensors, &ChannelConfig::window_m);
  limits.hard_window_m = per_channel(file.sensors, [](const ChannelConfig& sensor) {
    return sensor.hard_window_m > 0.0 ? sensor.hard_window_m : 2.0 * sensor.window_m;
  });
  limits.deviation_m = per_channel(file.sensors, [](const ChannelConfig& sensor) {
    if (is_acceleration(sensor.channel)) return kUnlimited;  // not predicted
    return sensor.deviation_m > 0.0 ? sensor.deviation_m : 0.5 * sensor.window_m;
  });
  limits.speed_m_s = limit_vector(file.sensors, &ChannelConfig::speed_m_s);
  limits.thermal_time_constant_s = file.thermal_time_constant_s;
}

void take_faults(const StageFile& file, StageConfig& config) {
  const StageInfo& info = config.spec.info;
  std::vector<SimulationSpec::Fault>& faults = config.simulation.faults;
  for (const FaultConfig& fault : file.faults) {
    faults.push_back(fault.fault);
    if (fault.channel.empty()) continue;
    const bool actuator = fault_traits(fault.fault.kind).target == FaultTarget::actuator;
    faults.back().channel =
        require_channel(config, actuator ? info.actuators : info.sensors, fault.channel,
                        actuator ? "actuator" : "sensor", "faults");
  }
}

void take_controller(StageConfig& config, const StageFile& file,
                     const std::array<double, kRigidAxes>& inertia) {
  const StageInfo& info = config.spec.info;
  MotionControllerSpec& controller = config.spec.controller;
  LinearControllerKeys linear = file.linear;
  if (!config.controller_text.empty())
    linear = parse_loop_controller(config.file.parent_path() / file.controller,
                                   config.controller_text, info.sample_rate_hz);
  if (file.controller.empty() && linear.empty()) {
    controller = motion_controller_spec(info.sample_rate_hz, info.actuators, info.sensors,
                                        file.axes, inertia);
  } else {
    controller.sample_rate_hz = info.sample_rate_hz;
    controller.by_peer = file.controller == kPeer;
    controller.sensor_decoupling.resize(0, std::ssize(info.sensors));
    controller.actuator_decoupling.resize(std::ssize(info.actuators), 0);
    take_linear_controller(linear, info.actuators, info.sensors, controller);
  }
  controller.feed_forward_ramp_s = config.ramp_s;
  controller.feed_forward_n = per_channel(file.actuators, &ChannelConfig::bias_n);
}

void complete_plant(StageConfig& config, const StageFile& file, PlantSpec& plant) {
  const StageInfo& info = config.spec.info;
  std::copy_n(file.inertia_kg_m2.begin(), 3, plant.inertia_kg_m2);
  std::copy_n(file.suspension_hz.begin(), 6, plant.suspension_hz);
  for (const InPlaneModeConfig& mode : file.in_plane_modes)
    plant.in_plane_modes.push_back(
        {mode.natural_frequency_hz, mode.damping_ratio,
         shape_vector(config, info.actuators, mode.actuators, "actuator"),
         shape_vector(config, info.sensors, mode.sensors, "sensor")});
}

void complete_config(StageConfig& config, const StageFile& file) {
  StageSpec& spec = config.spec;
  spec.info.backend = to_string(config.backend);
  spec.info.maximum_rate_hz = spec.info.sample_rate_hz;
  spec.info.clock = config.pace > 0.0 ? Clock::wall : Clock::virtual_time;
  if (config.plant) complete_plant(config, file, *config.plant);
  take_limits(file, spec.limits);
  take_faults(file, config);
  const auto inertia = config.plant.value_or(PlantSpec{}).axis_inertia();
  take_controller(config, file, inertia);
  spec.limits.motion =
      rigid_motion(spec.controller, spec.info.actuators, spec.info.sensors, inertia);
}

StageFile stage_file(const YamlDocument& document) {
  StageFile file;
  read_config(document, [&](ConfigVisitor& visitor) { describe_stage_file(visitor, file); });
  file.config.spec.info.actuators = channels_of(file.actuators);
  file.config.spec.info.sensors = channels_of(file.sensors);
  return file;
}

StageConfig stage_config(const std::filesystem::path& path, const YamlDocument& document,
                         StageFile file, std::string controller_text) {
  StageConfig config = std::move(file.config);
  config.file = path;
  config.text = document.text();
  config.controller_text = std::move(controller_text);
  if (config.plugin) config.plugin->library = path.parent_path() / config.plugin->library;
  // Errors of the libraries get the name of the file; they contain the place themselves.
  try {
    complete_config(config, file);
    if (file.can.config.present)
      config.can = complete_can(file.can, config.spec.info, config.spec.limits);
    if (config.plant) {
      const SimulatedStage stage(config.spec.info, *config.plant, config.simulation);
    }
    complete_limits(config.spec.limits, config.spec.info);
    const MotionController controller(config.spec.controller);
  } catch (const std::invalid_argument& error) {
    throw FormatError(path, "", error.what());
  }
  return config;
}

}  // namespace

void describe_stage_keys(ConfigVisitor& visitor) {
  StageFile file;
  describe_stage_file(visitor, file);
}

StageConfig load_stage_config(const std::filesystem::path& path) {
  const YamlDocument document = YamlDocument::read(path);
  StageFile file = stage_file(document);
  std::string controller;
  if (!file.controller.empty() && file.controller != kPeer)
    controller = loop_controller_text(path.parent_path() / file.controller, file.config.spec.info);
  return stage_config(path, document, std::move(file), std::move(controller));
}

StageConfig parse_stage_config(const std::filesystem::path& name, std::string text,
                               std::string controller_text) {
  const YamlDocument document = YamlDocument::parse(name, std::move(text));
  StageFile file = stage_file(document);
  if (!file.controller.empty() && file.controller != kPeer && controller_text.empty())
    throw FormatError(name, "", "the controller is in another file, which is unknown");
  return stage_config(name, document, std::move(file), std::move(controller_text));
}

StageInfo stage_info(const std::filesystem::path& name, std::string text) {
  return stage_file(YamlDocument::parse(name, std::move(text))).config.spec.info;
}

std::vector<PlantMode> flexible_modes_seen(const StageInfo& info, const PlantSpec& plant,
                                           const std::vector<std::string>& actuators,
                                           const std::vector<std::string>& sensors) {
  const auto seen = [](const Eigen::VectorXd& shape, const std::vector<Channel>& channels,
                       const std::vector<std::string>& names) {
    const double largest = shape.cwiseAbs().maxCoeff();
    return std::ranges::any_of(names, [&](const std::string& name) {
      const int index = channel_index(channels, name);
      return index >= 0 && std::abs(shape[index]) > 1e-6 * largest;
    });
  };
  const std::vector<PlantMode> all = plant_modes(info, plant);
  std::vector<PlantMode> modes;
  for (std::size_t i = kRigidAxes; i < all.size(); ++i) {
    Eigen::VectorXd shape = all[i].sensor_shape;
    if (all[i].acceleration_shape.size() > 0) shape += all[i].acceleration_shape;
    if (seen(all[i].actuator_shape, info.actuators, actuators) &&
        seen(shape, info.sensors, sensors))
      modes.push_back(all[i]);
  }
  return modes;
}

}  // namespace stageid
