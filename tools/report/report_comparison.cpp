#include "tools/report/report_comparison.hpp"

#include <fmt/format.h>

#include <cmath>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/modal_assurance.hpp"
#include "tools/report/report_diagrams.hpp"
#include "tools/steps/fit_step.hpp"

namespace stageid::report {
namespace {

/// Largest relative distance of two lines that are considered equal.
constexpr double kSameLine = 1e-9;

void check_channels(const ReportData& own, const std::string& title, const ChannelList& outputs,
                    const ChannelList& inputs) {
  const ChannelList& own_outputs = own.frf ? own.frf->outputs : own.model->outputs;
  const ChannelList& own_inputs = own.frf ? own.frf->inputs : own.model->inputs;
  if (outputs.names == own_outputs.names && inputs.names == own_inputs.names) return;
  fail_request(
      "{}: its channels differ from those of the report ({} x {}, first {} <- {}); "
      "compare results with the same channels",
      title, own_outputs.size(), own_inputs.size(),
      own_outputs.names.empty() ? "none" : own_outputs.names[0],
      own_inputs.names.empty() ? "none" : own_inputs.names[0]);
}

/// The columns of `other` on the lines of `own`; 0 x 0 if one is missing.
Eigen::MatrixXcd on_lines_of(const FrfEstimate& own, const FrfEstimate& other) {
  Eigen::MatrixXcd out(other.response.rows(), own.lines());
  Eigen::Index at = 0;
  for (Eigen::Index k = 0; k < own.lines(); ++k) {
    const double wanted = own.frequency_hz[k];
    while (at < other.lines() && other.frequency_hz[at] < wanted * (1.0 - kSameLine)) ++at;
    if (at == other.lines() || other.frequency_hz[at] > wanted * (1.0 + kSameLine)) return {};
    out.col(k) = other.response.col(at);
  }
  return out;
}

void add_response(ReportComparison& comparison, ReportData& own, const FrfEstimate& frf) {
  const auto leave_out = [&](const char* why) {
    own.notes.push_back(fmt::format("{}: response not shown: {}", comparison.title, why));
  };
  if (!own.frf) return leave_out("the report contains no response to compare with");
  if (frf.compensated != own.frf->compensated || frf.hold != own.frf->hold ||
      frf.delay_s != own.frf->delay_s)
    return leave_out("its hold or delay compensation differs");
  comparison.response = on_lines_of(*own.frf, frf);
  if (comparison.response.size() == 0) return leave_out("its lines differ");
  if (comparison.response != own.frf->response) return;
  comparison.response.resize(0, 0);
  leave_out("identical response");
}

const Submodel& submodel_of(const AdditiveModel& model, const ModeShape& mode) {
  return model.submodels[mode.submodel];
}

SortedJson modes_json(const AdditiveModel& model, const std::vector<ModeShape>& modes) {
  SortedJson out = SortedJson::array();
  for (const ModeShape& mode : modes) {
    const Submodel& submodel = submodel_of(model, mode);
    out.push_back({{"frequency_hz", mode.natural_frequency_hz},
                   {"frequency_std_hz", or_null(submodel.natural_frequency_std_hz)},
                   {"damping_ratio", mode.damping_ratio},
                   {"damping_std", or_null(submodel.damping_ratio_std)}});
  }
  return out;
}

SortedJson deviation(double difference, const std::optional<double>& first,
                     const std::optional<double>& second) {
  if (!first || !second) return SortedJson();
  const double std = std::hypot(*first, *second);
  return std > 0.0 ? SortedJson(difference / std) : SortedJson();
}

SortedJson pair_json(const ModePair& pair, const ReportData& own,
                     const std::vector<ModeShape>& ours, const std::vector<ModeShape>& theirs) {
  const ModeShape& first = ours[pair.first];
  const ModeShape& second = theirs[pair.second];
  const Submodel& a = submodel_of(*own.model, first);
  const Submodel& b = submodel_of(*own.comparison->model, second);
  const double shift_hz = second.natural_frequency_hz - first.natural_frequency_hz;
  const double shift = second.damping_ratio - first.damping_ratio;
  return {{"own", pair.first},
          {"other", pair.second},
          {"frequency_difference", pair.frequency_difference},
          {"frequency_deviation",
           deviation(shift_hz, a.natural_frequency_std_hz, b.natural_frequency_std_hz)},
          {"damping_difference",
           first.damping_ratio > 0.0 ? SortedJson(shift / first.damping_ratio) : SortedJson()},
          {"damping_deviation", deviation(shift, a.damping_ratio_std, b.damping_ratio_std)},
          {"output_mac", pair.output_mac},
          {"input_mac", pair.input_mac}};
}

}  // namespace

ReportComparison make_comparison(ReportData& own, std::string title,
                                 std::optional<AdditiveModel> model,
                                 const std::optional<FrfEstimate>& frf) {
  if (!own.frf && !own.model)
    fail_request("--compare: the report has neither a response nor a model; add one to its inputs");
  if (frf) check_channels(own, title, frf->outputs, frf->inputs);
  if (model) check_channels(own, title, model->outputs, model->inputs);
  ReportComparison comparison;
  comparison.title = std::move(title);
  if (frf) add_response(comparison, own, *frf);
  if (model && own.frf) comparison.model_response = response_like(*model, *own.frf);
  comparison.model = std::move(model);
  return comparison;
}

SortedJson comparison_json(const ReportData& own) {
  SortedJson out = {{"title", own.comparison->title}};
  if (!own.model || !own.comparison->model) return out;
  const std::vector<ModeShape> ours = shapes_by_frequency(*own.model);
  const std::vector<ModeShape> theirs = shapes_by_frequency(*own.comparison->model);
  out["own"] = modes_json(*own.model, ours);
  out["modes"] = modes_json(*own.comparison->model, theirs);
  out["pairs"] = SortedJson::array();
  if (ours.empty() || theirs.empty()) return out;
  for (const ModePair& pair : pair_modes(ours, theirs))
    out["pairs"].push_back(pair_json(pair, own, ours, theirs));
  out["output_mac"] =
      matrix_json(modal_assurance(output_shapes(ours), output_shapes(theirs)), rounded_mac);
  out["input_mac"] =
      matrix_json(modal_assurance(input_shapes(ours), input_shapes(theirs)), rounded_mac);
  return out;
}

}  // namespace stageid::report
