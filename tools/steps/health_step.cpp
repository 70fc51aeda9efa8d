#include "tools/steps/health_step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "frf/health/estimate_check.hpp"
#include "frf/health/sensor_steps.hpp"
#include "tools/config/stage_expectation.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

/// The cause is for programs only; stored findings need severity and texts.
Finding finding_of(const Json& object) {
  Finding finding;
  finding.severity = from_word<Severity>(text_in(object, "severity")).value_or(finding.severity);
  finding.cause = from_word<Cause>(text_in(object, "cause")).value_or(finding.cause);
  finding.channel = text_in(object, "channel");
  finding.what = text_in(object, "what");
  finding.figure = text_in(object, "figure");
  finding.remedy = text_in(object, "remedy");
  return finding;
}

bool has(const std::vector<Finding>& findings, Cause cause) {
  return std::ranges::any_of(findings, [&](const Finding& f) { return f.cause == cause; });
}

}  // namespace

std::vector<Finding> examine_log(const LogReader& log, const std::filesystem::path& stage_file,
                                 const Console& console) {
  const auto nominal = nominal_stage_of(log.info(), stage_file);
  Progress progress(console, "health", "MB", kMegabytesPerByte);
  FrfOptions options;
  options.progress = [&](double done, double total) {
    throw_if_interrupted();
    progress.update(done, total);
  };
  std::optional<FrfAndHealth> both;
  try {
    both = estimate_plant_frf_and_health({&log}, options);
  } catch (const FormatError&) {
    // Data without an estimate can still be examined, which gives the reason.
  } catch (const std::invalid_argument&) {
  }
  if (!both) return check_health(read_health_record({&log}, options), nominal);
  return keep_health(both->frf, examine(both->frf, std::move(both->health), nominal));
}

std::vector<Finding> examine(const FrfEstimate& frf, HealthRecord record,
                             const std::optional<NominalStage>& nominal) {
  const std::vector<NoisyRun> noisy = record.noisy_runs;
  const bool start_known = !record.start.runs.empty();
  const bool steps_known = record.steps.size() >= frf.inputs.size();
  std::vector<Finding> coarse = check_sensor_steps(frf, record);
  std::vector<Finding> findings = check_health(std::move(record), nominal);
  std::ranges::move(coarse, std::back_inserter(findings));
  // A drift and a transient look like noise. So does everything if the response to an axis is not determined for want
  // of excitation.
  if (!has(findings, Cause::drift) && !has(findings, Cause::unsettled) &&
      !has(findings, Cause::excitation))
    for (Finding& finding : check_experiment_noise(frf, noisy, start_known))
      findings.push_back(std::move(finding));
  // It comes from the steps, and the response is that to them.
  const auto comes_from_steps = [](const Finding& finding) {
    return finding.cause == Cause::limit_cycle || finding.cause == Cause::incoherent;
  };
  if (steps_known && std::ranges::all_of(findings, [&](const Finding& finding) {
        return finding.severity != Severity::fault || comes_from_steps(finding);
      }))
    for (Finding& finding : findings)
      if (comes_from_steps(finding)) finding.severity = Severity::doubt;
  return findings;
}

std::vector<std::string> health_lines(const std::vector<Finding>& findings) {
  std::vector<std::vector<std::string>> rows = {{"health", "channel", "what", "figure", "remedy"}};
  bool fine = true;
  for (const Finding& f : findings) {
    fine = fine && f.severity == Severity::unchecked;
    rows.push_back({to_string(f.severity), f.channel, f.what, f.figure, f.remedy});
  }
  std::vector<std::string> lines;
  if (fine) lines.push_back("data health: no findings");
  if (rows.size() == 1) return lines;
  for (std::string& line : table_lines(rows)) lines.push_back(std::move(line));
  return lines;
}

Json health_json(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& f : findings)
    list.push_back({{"severity", to_string(f.severity)},
                    {"cause", to_string(f.cause)},
                    {"channel", f.channel},
                    {"what", f.what},
                    {"figure", f.figure},
                    {"remedy", f.remedy}});
  return list;
}

std::vector<std::string> health_notes(const std::vector<Finding>& findings,
                                      std::optional<Severity> only) {
  std::vector<std::string> notes;
  for (const Finding& f : findings) {
    if (f.severity == Severity::unchecked || f.severity != only.value_or(f.severity)) continue;
    notes.push_back(fmt::format("{}{}{} ({}); {}", f.channel, f.channel.empty() ? "" : ": ", f.what,
                                f.figure, f.remedy));
  }
  return notes;
}

std::vector<Finding> keep_health(FrfEstimate& frf, std::vector<Finding> findings) {
  for (Finding& finding : check_interpolation(frf)) findings.push_back(std::move(finding));
  // Drift, ringing modes and steps are already reported; the bands that they affect add little.
  const auto settled_so_far = [&] {
    return !has(findings, Cause::drift) && !has(findings, Cause::unsettled) &&
           !has(findings, Cause::actuator_step);
  };
  if (settled_so_far())
    for (Finding& finding : check_discarded_starts(frf)) findings.push_back(std::move(finding));
  std::vector<Finding> unsettled_bands;
  if (settled_so_far()) unsettled_bands = check_settling(frf);
  withdraw_linearity_test(frf, findings);
  for (Finding& finding : unsettled_bands) findings.push_back(std::move(finding));
  std::ranges::stable_sort(
      findings, [](const Finding& a, const Finding& b) { return rank_of(a) < rank_of(b); });
  Json provenance = parse_json_object<Json>(frf.provenance_json);
  provenance["health"] = health_json(findings);
  frf.provenance_json = json_line(provenance);
  return findings;
}

std::vector<Finding> health_of(const std::string& provenance_json) {
  std::vector<Finding> findings;
  for (const Json& object : list_in(parse_json<Json>(provenance_json), "health"))
    if (object.is_object()) findings.push_back(finding_of(object));
  return findings;
}

}  // namespace stageid
