#include "tools/config/stage_expectation.hpp"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tools/config/controller_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/strict_yaml.hpp"

namespace stageid {
namespace {

constexpr double kFreeOverSuspension = 10.0;  // the spring is 1 % of the inertia there

std::vector<std::string> names_of(const std::vector<Channel>& channels) {
  std::vector<std::string> names;
  for (const Channel& channel : channels) names.push_back(channel.name);
  return names;
}

/// Channels that are not in the controller file have a zero response of the controller.
NominalStage with_channels_of(const LogInfo& info, NominalStage known) {
  NominalStage all = known;
  const auto append = [](std::vector<std::string>& names, const std::vector<std::string>& more) {
    for (const std::string& name : more)
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  append(all.actuators, info.actuators.names);
  append(all.sensors, info.sensors.names);
  const auto n_u = static_cast<Eigen::Index>(all.actuators.size());
  const auto n_y = static_cast<Eigen::Index>(all.sensors.size());
  all.controller = [n_u, n_y, controller = known.controller](double frequency_hz) {
    const Eigen::MatrixXcd part = controller(frequency_hz);
    Eigen::MatrixXcd whole = Eigen::MatrixXcd::Zero(n_u, n_y);
    whole.topLeftCorner(part.rows(), part.cols()) = part;
    return whole;
  };
  if (known.rigid_body)
    all.rigid_body = [n_u, n_y, rigid_body = known.rigid_body](double frequency_hz) {
      const Eigen::MatrixXcd part = rigid_body(frequency_hz);
      Eigen::MatrixXcd whole = Eigen::MatrixXcd::Zero(n_y, n_u);
      whole.topLeftCorner(part.rows(), part.cols()) = part;
      return whole;
    };
  return all;
}

}  // namespace

NominalStage nominal_stage(const WaferStageSpec& spec) {
  NominalStage nominal;
  nominal.actuators = names_of(spec.info.actuators);
  nominal.sensors = names_of(spec.info.sensors);
  if (!spec.controller.by_peer) {
    const auto controller = std::make_shared<const MotionController>(spec.controller);
    nominal.controller = [controller](double frequency_hz) {
      return controller->response(frequency_hz);
    };
  }
  if (!spec.has_plant()) return nominal;
  std::vector<PlantMode> rigid = wafer_stage_modes(spec);
  rigid.resize(kRigidAxes);
  nominal.rigid_body = [rigid, delay_s = spec.delay_s,
                        rate_hz = spec.info.sample_rate_hz](double frequency_hz) {
    return sampled_response(rigid, delay_s, rate_hz, frequency_hz);
  };
  nominal.free_from_hz = kFreeOverSuspension * *std::max_element(std::begin(spec.suspension_hz),
                                                                 std::end(spec.suspension_hz));
  return nominal;
}

std::optional<NominalStage> nominal_stage_of(const LogInfo& info,
                                             const std::filesystem::path& stage_file) {
  if (!stage_file.empty()) {
    const YamlDocument document = YamlDocument::read(stage_file);
    if (is_controller_file(document)) return with_channels_of(info, read_controller_file(document));
    return nominal_stage(load_stage_config(stage_file).spec);
  }
  const auto json = parse_json<nlohmann::json>(info.metadata_json);
  const std::string stage = text_in(json, "stage");
  if (stage.empty()) return std::nullopt;
  try {
    return nominal_stage(
        parse_stage_config(text_in(json, "stage_file"), stage, text_in(json, "controller")).spec);
  } catch (const FormatError&) {
    return std::nullopt;  // written by another version; --stage can name a readable file
  }
}

}  // namespace stageid
