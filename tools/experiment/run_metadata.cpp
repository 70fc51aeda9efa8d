#include "tools/experiment/run_metadata.hpp"

#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/files/version.hpp"
#include "acquisition/record/utc_time.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

std::string run_metadata(const ExperimentConfig& config, Backend backend, const StageInfo& stage) {
  Json json = {
      {"program", "stageid"},
      {"stageid_version", version()},
      {"started_utc", utc_now()},
      {"backend", to_string(backend)},
      {"measurement_id", config.measurement_id},
      {"seeds", {{"experiment", config.experiment.seed}, {"noise", config.stage.simulation.seed}}},
      {"transport_delay_s", config.stage.spec.info.delay_s},
      {"configuration_file", config.file.filename().string()},
      {"configuration", config.text},
      {"stage_file", config.stage.file.filename().string()},
      {"stage", config.stage.text}};
  if (!config.stage.controller_text.empty()) json["controller"] = config.stage.controller_text;
  // There is no pace in virtual time, so its logs do not contain one.
  if (stage.clock == Clock::wall) json["pace"] = stage.pace;
  return json.dump();
}

std::string measurement_id_of(const LogInfo& info) {
  return text_in(parse_json<Json>(info.metadata_json), "measurement_id");
}

double wall_period_s(const LogInfo& info) {
  const double pace = number_in(parse_json<Json>(info.metadata_json), "pace").value_or(0.0);
  return pace > 0.0 ? 1.0 / (info.sample_rate_hz * pace) : 0.0;
}

}  // namespace stageid
