#include "tools/fit_step.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "excitation/fingerprint.hpp"
#include "tools/frf_quality.hpp"
#include "tools/health_step.hpp"
#include "tools/interrupt.hpp"

namespace stageid {
namespace {

using Json = nlohmann::ordered_json;

std::string provenance(const FitSetup& setup, const FitResult& result, const std::string& frf_name,
                       const std::string& frf_fingerprint) {
  Json json;
  json["stageid_version"] = STAGEID_VERSION;
  json["made_by"] = "fit";
  json["request_id"] = fit_request_id(setup, frf_fingerprint);
  json["inputs"] = {{{"file", frf_name}, {"fingerprint", frf_fingerprint}}};
  json["options"] = Json::parse(setup.request_json);
  json["decisions"] = result.decisions;
  const Json frf = Json::parse(setup.frf.provenance_json, nullptr, false);
  json["frf"] = frf.is_discarded() ? Json::object() : frf;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string optional_number(const std::optional<double>& value) {
  return value ? fmt::format("{:.2g}", *value) : "-";
}

Json optional_json(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

/// A mode as its own pole; other submodels' as the fit left them.
std::vector<PoleEstimate> poles_of(const Submodel& s) {
  if (!s.is_mode()) return s.poles;
  return {{s.natural_frequency_hz(), s.damping_ratio(), s.natural_frequency_std_hz,
           s.damping_ratio_std}};
}

/// Puts a cause before the message of a fit that is not to be trusted.
void blame(const std::string& cause, FitResult& result) {
  if (cause.empty() || result.trustworthy()) return;
  result.message = cause + "; " + result.message;
  result.model.fit.message = result.message;
}

}  // namespace

std::string fit_request_id(const FitSetup& setup, const std::string& frf_fingerprint) {
  return fingerprint_of(
      fmt::format("{} {} {}", STAGEID_VERSION, frf_fingerprint, setup.request_json));
}

FitStep fit_model(const FitSetup& setup, const std::string& frf_name,
                  const std::string& frf_fingerprint, const Console& console) {
  FitStep step;
  FitOptions options = setup.options;
  Progress progress(console, "fit", "iterations");
  throw_if_interrupted();
  options.interrupted = [] { return interrupt_flag().load(); };
  options.progress = [&](int iteration, double cost) {
    progress.update(iteration, 0.0, fmt::format("cost {:.6g}", cost));
  };
  step.result = structured_fit(setup.frf, setup.structure, setup.selection, options);
  // The cause comes before what follows from it: modes that imitate distortion.
  blame(nonlinearity_sentence(setup.frf), step.result);
  const std::vector<std::string> faults =
      health_notes(health_of(setup.frf.provenance_json), Severity::fault);
  if (!faults.empty())
    step.result.distrust(FitStatus::faulty_data, fmt::format("{}", fmt::join(faults, "; ")));
  step.seconds = progress.seconds();
  step.result.decisions.insert(step.result.decisions.begin(), setup.notes.begin(),
                               setup.notes.end());
  step.result.model.provenance_json = provenance(setup, step.result, frf_name, frf_fingerprint);
  return step;
}

std::vector<std::string> decisions_of(const AdditiveModel& model) {
  const Json json = Json::parse(model.provenance_json, nullptr, false);
  std::vector<std::string> decisions;
  if (!json.is_object() || !json.contains("decisions") || !json["decisions"].is_array())
    return decisions;
  for (const Json& line : json["decisions"])
    if (line.is_string()) decisions.push_back(line.get<std::string>());
  return decisions;
}

std::vector<std::string> mode_table(const AdditiveModel& model) {
  std::vector<std::vector<std::string>> rows = {
      {"mode", "frequency/Hz", "std/Hz", "damping", "std"}};
  for (const Submodel& s : model.submodels) {
    for (const PoleEstimate& pole : poles_of(s))
      rows.push_back(
          {fmt::format("{}", rows.size()), fmt::format("{:.5f}", pole.natural_frequency_hz),
           optional_number(pole.natural_frequency_std_hz),
           fmt::format("{:.6f}", pole.damping_ratio), optional_number(pole.damping_ratio_std)});
  }
  return table_lines(rows);
}

std::string cost_line(const std::vector<double>& cost) {
  if (cost.empty()) return "cost: no iteration";
  if (cost.size() == 1) return fmt::format("cost: {:.6g}", cost.front());
  return fmt::format("cost: {:.6g} -> {:.6g} in {} iterations", cost.front(), cost.back(),
                     cost.size() - 1);
}

nlohmann::ordered_json modes_json(const AdditiveModel& model) {
  Json list = Json::array();
  for (const Submodel& s : model.submodels)
    if (s.is_mode())
      list.push_back({{"natural_frequency_hz", s.natural_frequency_hz()},
                      {"natural_frequency_std_hz", optional_json(s.natural_frequency_std_hz)},
                      {"damping_ratio", s.damping_ratio()},
                      {"damping_ratio_std", optional_json(s.damping_ratio_std)}});
  return list;
}

}  // namespace stageid
