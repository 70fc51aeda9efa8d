#include "tools/steps/frf_step.hpp"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/files/version.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "tools/config/stage_expectation.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

/// The reproducible part of the metadata of a log: everything except times.
Json lasting_metadata(const LogReader& log) {
  Json metadata = parse_json_object<Json>(log.info().metadata_json);
  metadata.erase("started_utc");
  return metadata;
}

Json options_json(const FrfOptions& options) {
  return {{"inputs", options.inputs},
          {"outputs", options.outputs},
          {"transient_periods", options.transient_periods.value_or(-1)},
          {"method", to_string(options.method)},
          {"covariance", to_string(options.covariance)},
          {"covariance_lines", options.covariance_lines},
          {"periods", to_string(options.periods)},
          {"realizations", options.realizations}};
}

std::string complete_provenance(const FrfEstimate& frf, const std::vector<const LogReader*>& logs,
                                const FrfOptions& options) {
  Json provenance = parse_json_object<Json>(frf.provenance_json);
  provenance["stageid_version"] = version();
  provenance["request_id"] = frf_request_id(logs, options);
  provenance["realizations"] = options.realizations;
  provenance["logs"] = Json::array();  // without folders: the result does not depend on them
  for (const LogReader* log : logs)
    if (!log->path().empty()) provenance["logs"].push_back(log->path().filename().string());
  provenance["experiments"] = Json::array();
  for (const LogReader* log : logs) provenance["experiments"].push_back(lasting_metadata(*log));
  return json_line(provenance);
}

}  // namespace

std::string frf_request_id(const std::vector<const LogReader*>& logs, const FrfOptions& options) {
  Json request = {{"version", version()}, {"options", options_json(options)}};
  for (const LogReader* log : logs) request["experiments"].push_back(lasting_metadata(*log));
  return fingerprint_of(json_line(request));
}

std::string request_id_of(const std::string& provenance_json) {
  return text_in(parse_json<Json>(provenance_json), "request_id");
}

FrfStep estimate_frf(const std::vector<std::filesystem::path>& files, const FrfOptions& options,
                     const HealthRequest& health, const Console& console) {
  std::vector<std::unique_ptr<LogReader>> readers;
  std::vector<const LogReader*> logs;
  for (const std::filesystem::path& file : files)
    logs.push_back(readers.emplace_back(open_log(file)).get());
  return estimate_frf(logs, options, health, console);
}

FrfStep estimate_frf(const std::vector<const LogReader*>& logs, FrfOptions options,
                     const HealthRequest& health, const Console& console) {
  FrfStep step;
  std::optional<NominalStage> nominal;  // before the long work, because a stage file may be invalid
  if (health.wanted) nominal = nominal_stage_of(logs.front()->info(), health.stage_file);
  Progress progress(console, "frf", "MB", kMegabytesPerByte);
  options.progress = [&](double done, double total) {
    throw_if_interrupted();
    step.bytes = done;
    progress.update(done, total);
  };
  if (health.wanted) {
    FrfAndHealth both = estimate_plant_frf_and_health(logs, options);
    step.frf = std::move(both.frf);
    step.findings = examine(step.frf, std::move(both.health), nominal);
  } else {
    step.frf = estimate_plant_frf(logs, options);
  }
  step.seconds = progress.seconds();
  step.frf.provenance_json = complete_provenance(step.frf, logs, options);
  if (health.wanted) step.findings = keep_health(step.frf, std::move(step.findings));
  return step;
}

std::string describe(const FrfEstimate& frf) {
  return fmt::format("{} x {} on {}, {} ... {} Hz, {} x {}", frf.n_outputs(), frf.n_inputs(),
                     counted(frf.lines(), "line"), frf.frequency_hz[0],
                     frf.frequency_hz[frf.lines() - 1], counted(frf.realizations, "realization"),
                     counted(frf.periods, "period"));
}

}  // namespace stageid
