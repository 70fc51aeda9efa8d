#include "tools/config/stage_expectation.hpp"

#include <algorithm>
#include <memory>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tools/config/controller_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/yaml_document.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

constexpr double kFreeOverSuspension = 10.0;  // the spring is 1 % of the inertia there

std::vector<std::string> texts_of(const std::vector<Channel>& channels,
                                  std::string Channel::*text) {
  std::vector<std::string> texts;
  for (const Channel& channel : channels) texts.push_back(channel.*text);
  return texts;
}

using Response = std::function<Eigen::MatrixXcd(double frequency_hz)>;

/// The response with further channels, which are zero.
Response padded(const Response& response, std::size_t rows, std::size_t columns) {
  return [=](double frequency_hz) {
    const Eigen::MatrixXcd part = response(frequency_hz);
    Eigen::MatrixXcd whole =
        Eigen::MatrixXcd::Zero(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
    whole.topLeftCorner(part.rows(), part.cols()) = part;
    return whole;
  };
}

/// Channels that are not in the controller file have a zero response of the controller.
NominalStage with_channels_of(const LogInfo& info, NominalStage all) {
  const auto append = [](std::vector<std::string>& names, const std::vector<std::string>& more) {
    for (const std::string& name : more)
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  };
  append(all.actuators, info.actuators.names);
  append(all.sensors, info.sensors.names);
  all.controller = padded(all.controller, all.actuators.size(), all.sensors.size());
  if (all.rigid_body)
    all.rigid_body = padded(all.rigid_body, all.sensors.size(), all.actuators.size());
  return all;
}

}  // namespace

NominalStage nominal_stage(const StageSpec& stage, const std::optional<PlantSpec>& plant) {
  NominalStage nominal;
  nominal.sample_rate_hz = stage.info.sample_rate_hz;
  nominal.actuators = texts_of(stage.info.actuators, &Channel::name);
  nominal.actuator_units = texts_of(stage.info.actuators, &Channel::unit);
  nominal.sensors = texts_of(stage.info.sensors, &Channel::name);
  nominal.sensor_units = texts_of(stage.info.sensors, &Channel::unit);
  if (!stage.controller.by_peer) {
    const auto controller = std::make_shared<const MotionController>(stage.controller);
    nominal.controller = [controller](double frequency_hz) {
      return controller->response(frequency_hz);
    };
  }
  if (!plant) return nominal;
  std::vector<PlantMode> rigid = plant_modes(stage.info, *plant);
  rigid.resize(kRigidAxes);
  nominal.rigid_body = [rigid, delay_s = stage.info.delay_s,
                        rate_hz = stage.info.sample_rate_hz](double frequency_hz) {
    return sampled_response(rigid, delay_s, rate_hz, frequency_hz);
  };
  nominal.free_from_hz = kFreeOverSuspension * *std::max_element(std::begin(plant->suspension_hz),
                                                                 std::end(plant->suspension_hz));
  return nominal;
}

std::optional<NominalStage> nominal_stage_of(const LogInfo& info,
                                             const std::filesystem::path& stage_file) {
  if (!stage_file.empty()) {
    const YamlDocument document = YamlDocument::read(stage_file);
    if (is_controller_file(document)) return with_channels_of(info, read_controller_file(document));
    const StageConfig config = load_stage_config(stage_file);
    return nominal_stage(config.spec, config.plant);
  }
  const auto json = parse_json<Json>(info.metadata_json);
  const std::string stage = text_in(json, "stage");
  if (stage.empty()) return std::nullopt;
  try {
    const StageConfig config =
        parse_stage_config(text_in(json, "stage_file"), stage, text_in(json, "controller"));
    return nominal_stage(config.spec, config.plant);
  } catch (const FormatError&) {
    return std::nullopt;  // written by another version; --stage can name a readable file
  }
}

}  // namespace stageid
