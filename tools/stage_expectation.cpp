#include "tools/stage_expectation.hpp"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "excitation/file_error.hpp"
#include "hal/motion_controller.hpp"
#include "hal/rigid_body.hpp"
#include "tools/stage_config.hpp"

namespace stageid {
namespace {

constexpr double kFreeOverSuspension = 10.0;  // the spring is 1 % of the inertia there

std::vector<std::string> names_of(const std::vector<Channel>& channels) {
  std::vector<std::string> names;
  for (const Channel& channel : channels) names.push_back(channel.name);
  return names;
}

}  // namespace

NominalStage nominal_stage(const WaferStageSpec& spec) {
  NominalStage nominal;
  nominal.actuators = names_of(spec.info.actuators);
  nominal.sensors = names_of(spec.info.sensors);
  const auto controller = std::make_shared<const MotionController>(spec.controller);
  nominal.controller = [controller](double frequency_hz) {
    return controller->response(frequency_hz);
  };
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
  if (!stage_file.empty()) return nominal_stage(load_stage_config(stage_file).spec);
  const auto json = nlohmann::json::parse(info.metadata_json, nullptr, false);
  if (!json.is_object() || !json.contains("stage") || !json["stage"].is_string())
    return std::nullopt;
  try {
    return nominal_stage(parse_stage_config(json.value("stage_file", "stage"), json["stage"]).spec);
  } catch (const FormatError&) {
    return std::nullopt;  // written by another version; --stage gives one that is understood
  }
}

}  // namespace stageid
