#include "tools/report/report_json.hpp"

#include <algorithm>
#include <cmath>

#include "acquisition/files/json_text.hpp"
#include "acquisition/files/version.hpp"
#include "estimation/model/cmif.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/responding_channels.hpp"
#include "tools/report/report_comparison.hpp"
#include "tools/report/report_diagrams.hpp"
#include "tools/report/report_encoding.hpp"
#include "tools/report/report_uncertainty.hpp"
#include "tools/report/report_verdict.hpp"
#include "tools/report/timing_json.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/steps/model_verdict.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ReportFigure, label, value)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ReportStep, name, seconds, note)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ReportDocument, name, text)

}  // namespace stageid
namespace stageid::report {
namespace {

SortedJson channels(const ChannelList& list) {
  SortedJson out = SortedJson::array();
  for (std::size_t i = 0; i < list.size(); ++i)
    out.push_back({{"name", list.names[i]}, {"unit", i < list.units.size() ? list.units[i] : ""}});
  return out;
}

/// An array that is already in the page, as decoded by the page.
struct Based {
  const char* id = "";
  const Eigen::MatrixXcd* values = nullptr;
};

/// Encodings of complex numbers and their names in the page.
struct ComplexType {
  const char* name;
  ComplexCode (*encode)(const Eigen::MatrixXcd& values, Expectation expected);
};
constexpr ComplexType kFloat32 = {"c64", encode_complex_float32};
constexpr ComplexType kBlock16 = {"c40", encode_complex_block16};

/// Blocks with their descriptions, always added together.
struct Arrays {
  void add(const std::string& id, const char* type, std::string text,
           SortedJson more = SortedJson::object()) {
    more["type"] = type;
    description[id] = std::move(more);
    blocks.push_back({id, std::move(text)});
  }
  /// Expected from the decoded numbers of `base` (none: 0), extrapolated by `order`. @returns the decoded
  Eigen::MatrixXcd add(const std::string& id, const ComplexType& type,
                       const Eigen::MatrixXcd& values, int order, const Based& base = {}) {
    ComplexCode code = type.encode(values, {base.values, order});
    SortedJson more = {{"order", order}};
    if (base.values != nullptr) more["base"] = base.id;
    add(id, type.name, std::move(code.text), std::move(more));
    return std::move(code.decoded);
  }
  /// Square roots of variances by std::sqrt, because that of Eigen is an approximation on some machines, and a page
  /// must not depend on the machine.
  void add_deviation(const std::string& id, const Eigen::MatrixXd& variance) {
    add_log_bytes(id, variance.unaryExpr([](double v) { return std::sqrt(v); }));
  }
  void add_log_bytes(const std::string& id, const Eigen::MatrixXd& values) {
    LogBytes bytes = encode_log_bytes(values);
    add(id, "log8", std::move(bytes.text), {{"low", bytes.low}, {"step", bytes.step}});
  }

  SortedJson description = SortedJson::object();
  std::vector<Block> blocks;
};

/// The model is stored as the residual, so that small errors of small numbers remain small in both.
void add_measured(const ReportData& data, Arrays& arrays) {
  const FrfEstimate& frf = *data.frf;
  Eigen::MatrixXcd residual;
  Based from_residual;
  if (data.model_response.size() > 0) {
    residual = arrays.add("residual", kBlock16, frf.response - data.model_response, 0);
    from_residual = {"residual", &residual};
  }
  // Measured minus residual is the model, which is smooth; second differences would amplify noise.
  const int order = from_residual.values != nullptr ? 2 : 1;
  const Eigen::MatrixXcd response =
      arrays.add("response", kFloat32, frf.response, order, from_residual);
  if (!data.comparison) return;
  Eigen::MatrixXcd other_model;
  Based like = {"response", &response};
  if (data.comparison->model_response.size() > 0) {
    other_model = arrays.add("other_model", kBlock16, data.comparison->model_response, 2);
    like = {"other_model", &other_model};
  }
  if (data.comparison->response.size() > 0)
    arrays.add("other_response", kBlock16, data.comparison->response, 0, like);
}

void add_response(const ReportData& data, Arrays& arrays) {
  const FrfEstimate& frf = *data.frf;
  arrays.add("frequency", "f64", encode_float64(frf.frequency_hz));
  add_measured(data, arrays);
  if (frf.interpolation_misfit.size() > 0)
    arrays.add("interpolation_misfit", "f32", encode_float32(frf.interpolation_misfit.transpose()));
  const Eigen::MatrixXd* const variance = uncertainty(frf).variance;
  if (variance != nullptr) arrays.add_deviation("deviation", *variance);
  if (data.cmif_curves.size() > 0) {
    arrays.add("cmif", "f32", encode_float32(data.cmif_curves),
               {{"curves", data.cmif_curves.rows()}});
    if (variance != nullptr)
      arrays.add_log_bytes("cmif_deviation", cmif_deviation(frf, CmifKind::accelerance, *variance));
  }
  if (data.model_response.size() == 0) return;
  if (data.model_variance.size() > 0) arrays.add_deviation("model_deviation", data.model_variance);
  if (data.validation_frf)
    arrays.add_log_bytes("validation_residual",
                         (data.validation_frf->response - data.model_response).cwiseAbs());
}

SortedJson frf_json(const FrfEstimate& frf) {
  SortedJson excluded = SortedJson::array();
  for (std::size_t i = 0; i < frf.excluded_channels.size(); ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    excluded.push_back(
        {{"name", frf.excluded_channels[i]},
         {"power", index < frf.excluded_power.size() ? SortedJson(frf.excluded_power[index])
                                                     : SortedJson()}});
  }
  const ChannelFlags responding = responding_channels(frf);
  return {
      {"inputs", channels(frf.inputs)},
      {"outputs", channels(frf.outputs)},
      {"responds", std::vector<bool>(responding.begin(), responding.end())},
      {"lines", frf.lines()},
      {"band_hz", {frf.frequency_hz[0], frf.frequency_hz[frf.lines() - 1]}},
      {"realizations", frf.realizations},
      {"periods", frf.periods},
      {"experiments", frf.experiments},
      {"sample_rate_hz", frf.sample_rate_hz},
      {"hold", frf.hold == Hold::zoh ? "zero-order hold" : "none"},
      {"compensated",
       frf.compensated == Compensation::hold ? "delay and hold" : to_string(frf.compensated)},
      {"delay_s", frf.delay_s},
      {"deviation", uncertainty(frf).kind},
      {"band_factor", std::sqrt(squared_error_quantile(0.95, uncertainty(frf).dof))},
      {"noise_dof", frf.noise_dof},
      {"correlated_lines", frf.correlated_lines},
      {"total_dof", frf.total_dof},
      {"worst_condition",
       frf.input_condition.size() > 0 ? SortedJson(frf.input_condition.maxCoeff()) : SortedJson()},
      {"excluded", excluded}};
}

SortedJson model_json(const AdditiveModel& model) {
  int modes = 0;
  SortedJson others = SortedJson::array();
  for (const Submodel& submodel : model.submodels) {
    if (submodel.is_mode())
      ++modes;
    else
      others.push_back({{"integrators", submodel.integrators},
                        {"order", static_cast<int>(submodel.denominator.size()) - 1}});
  }
  return {{"modes", modes},
          {"others", others},
          {"hold", to_string(model.hold)},
          {"delay_s", {{"inputs", model.input_delay_s}, {"outputs", model.output_delay_s}}},
          {"cost", model.fit.cost},
          {"weighting", model.fit.weighting},
          {"iterations", model.fit.iterations},
          {"status", model.fit.status_word()},
          {"relative_rms_error", model.fit.relative_rms_error},
          {"band_hz", {model.fit.band_hz[0], model.fit.band_hz[1]}},
          {"seconds", model.fit.seconds}};
}

SortedJson modes_json(const ReportData& data) {
  SortedJson out = SortedJson::array();
  for (const ModeRow& row : mode_rows(*data.model, data.true_modes)) {
    SortedJson truth;
    if (row.truth)
      truth = {{"frequency_hz", row.truth->natural_frequency_hz},
               {"damping_ratio", row.truth->damping_ratio}};
    out.push_back({{"frequency_hz", or_null(row.frequency_hz)},
                   {"frequency_std_hz", or_null(row.frequency_std_hz)},
                   {"damping_ratio", or_null(row.damping_ratio)},
                   {"damping_std", or_null(row.damping_std)},
                   {"truth", truth},
                   {"frequency_deviation", or_null(row.frequency_deviation())},
                   {"damping_deviation", or_null(row.damping_deviation())}});
  }
  return out;
}

SortedJson run_json(const LogRun& run, double sample_rate_hz) {
  const double recorded_s =
      sample_rate_hz > 0.0 ? static_cast<double>(run.samples) / sample_rate_hz : 0.0;
  return {{"name", run.name},
          {"realization", run.realization},
          {"experiment", run.experiment},
          {"samples", run.samples},
          {"complete", run.complete},
          {"started_utc", run.started_utc},
          {"cycles", run.health.cycles},
          {"late", run.health.late},
          {"missing", run.health.missing},
          {"marked", run.health.marked},
          {"largest_lateness_s", 1e-9 * static_cast<double>(run.health.largest_lateness_ns)},
          {"seconds", run.health.seconds},
          {"recorded_s", recorded_s}};
}

SortedJson provenances_json(const ReportData& data) {
  SortedJson out = SortedJson::array();
  // As JSON if it can be parsed, else as text.
  const auto add = [&out](const char* of, const std::string& text) {
    SortedJson content = parse_json<SortedJson>(text);
    if (content.is_discarded()) content = text;
    if (!content.empty()) out.push_back({{"of", of}, {"content", std::move(content)}});
  };
  if (data.frf) add("frequency response", data.frf->provenance_json);
  if (data.validation_frf) add("held-back response", data.validation_frf->provenance_json);
  if (data.model) add("model", data.model->provenance_json);
  return out;
}

SortedJson candidates_json(const std::vector<ModeCandidate>& candidates) {
  SortedJson out = SortedJson::array();
  for (const ModeCandidate& mode : candidates)
    out.push_back({{"frequency_hz", mode.frequency_hz}, {"curve", mode.cmif_curve}});
  return out;
}

/// Always valid UTF-8, and safe inside <script>.
std::string text_of(const SortedJson& json) { return script_safe(in_ascii(json)); }

}  // namespace

PageContent page_content(const ReportData& data) {
  Arrays arrays;
  SortedJson json = {{"notes", data.notes},
                     {"figures", data.figures},
                     {"steps", data.steps},
                     {"documents", data.documents}};
  const Verdict verdict = judge(data);
  json["verdict"] = verdict_json(verdict);
  json["title"] = data.title;
  json["version"] = version();
  json["decisions"] = data.model ? decisions_of(*data.model) : std::vector<std::string>();
  json["provenance"] = provenances_json(data);
  json["candidates"] = candidates_json(data.chosen_modes);
  json["cost"] = data.model ? data.model->cost_history : std::vector<double>();
  RunTiming timing;
  for (const LogRun& run : data.runs) timing += run.timing;
  json["timing"] = timing_json(timing);
  json["period_s"] = data.period_s > 0.0 ? SortedJson(data.period_s) : SortedJson();
  json["runs"] = SortedJson::array();
  for (const LogRun& run : data.runs) json["runs"].push_back(run_json(run, data.sample_rate_hz));
  json["sample_rate_hz"] = data.sample_rate_hz;
  if (data.frf) {
    json["frf"] = frf_json(*data.frf);
    add_response(data, arrays);
  }
  if (data.model) {
    json["model"] = model_json(*data.model);
    json["modes"] = modes_json(data);
    json["shapes"] = shapes_json(*data.model);
    json["shape_channels"] = {{"outputs", channels(data.model->outputs)},
                              {"inputs", channels(data.model->inputs)}};
    json["geometry"] = geometry_json(data.geometry, data.model->outputs, data.model->inputs);
  }
  json["findings"] = health_json(data.findings);
  if (!data.stabilization.empty()) json["stabilization"] = stabilization_json(data.stabilization);
  if (data.nonlinearity) json["nonlinearity"] = nonlinearity_json(*data.nonlinearity);
  if (!data.controller_view.empty()) json["loop"] = parse_json<SortedJson>(data.controller_view);
  if (data.comparison) json["comparison"] = comparison_json(data);
  if (data.validation) json["validation"] = validation_json(*data.validation);
  json["arrays"] = std::move(arrays.description);
  return {text_of(json), std::move(arrays.blocks)};
}

}  // namespace stageid::report
