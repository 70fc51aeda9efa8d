#include "frf/plant/frf_provenance.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/version.hpp"
#include "frf/response/channel_positions.hpp"

namespace stageid {

FrfProvenance::FrfProvenance(const LogInfo& info, const FrfOptions& options,
                             const ChannelChoice& channels)
    : info_(info), options_(options), channels_(channels) {}

void FrfProvenance::add(const UsedRun& run, const std::string& fingerprint) {
  auto at = std::ranges::find(logs_, run.log, &Log::log);
  if (at == logs_.end()) at = logs_.insert(logs_.end(), Log{run.log, {}, {}});
  at->runs.emplace_back(run.run().realization, run.run().experiment);
  at->fingerprints += fingerprint;
}

std::string FrfProvenance::json() const {
  using Json = nlohmann::ordered_json;
  Json inputs = Json::array();
  for (const Log& log : logs_) {
    inputs.push_back({{"file", log.log->path().filename().string()},
                      {"fingerprint", fingerprint_of(log.fingerprints)},
                      {"runs", log.runs}});
  }
  const Json options = {{"method", to_string(options_.method)},
                        {"inputs", channels_.inputs},
                        {"outputs", pick(info_.sensors, channels_.outputs).names},
                        {"transient_periods", transient_periods(info_, options_)},
                        {"period_samples", info_.period_samples},
                        {"covariance", to_string(options_.covariance)},
                        {"covariance_lines", options_.covariance_lines},
                        {"periods", to_string(options_.periods)}};
  return Json{{"stageid_version", version()},
              {"made_by", "estimate_plant_frf"},
              {"inputs", inputs},
              {"options", options}}
      .dump();
}

std::string with_steps(const std::string& provenance_json, const std::vector<ActuatorStep>& steps,
                       const ChannelList& actuators) {
  using Json = nlohmann::ordered_json;
  Json provenance = Json::parse(provenance_json);
  for (const ActuatorStep& s : steps)
    provenance["actuator_steps"].push_back({{"actuator", actuators.name(s.actuator)},
                                            {"step", s.step},
                                            {"unit", actuators.unit(s.actuator)},
                                            {"rounding", to_string(s.rounding)}});
  return provenance.dump();
}

}  // namespace stageid
