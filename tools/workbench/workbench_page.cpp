#include "tools/workbench/workbench_page.hpp"

#include <fmt/format.h>

#include <utility>

#include "tools/report/html_page.hpp"
#include "tools/report/report_comparison.hpp"
#include "tools/report/report_encoding.hpp"
#include "tools/report/report_json.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/terminal/json.hpp"
#include "tools/workbench/fit_details.hpp"

namespace stageid {
namespace {

ReportData without_model(ReportData data) {
  data.model.reset();
  data.model_response.resize(0, 0);
  data.model_variance.resize(0, 0);
  data.validation.reset();
  data.controller_view.clear();
  data.chosen_modes.clear();
  return data;
}

ReportData without_response(ReportData data) {
  data.frf.reset();
  data.validation_frf.reset();
  data.cmif_curves.resize(0, 0);
  data.stabilization.clear();
  data.nonlinearity.reset();
  return data;
}

/// Complex numbers for the page, by themselves: those of the report expect others before them.
constexpr int kSmooth = 2;  // order of the expectation, see report::Expectation
std::string encoded(const Eigen::MatrixXcd& values, int order) {
  return values.size() == 0 ? "" : report::encode_complex_block16(values, {nullptr, order}).text;
}

void add_array(const char* name, const std::string& text, const SortedJson& about,
               SortedJson& json) {
  if (text.empty()) return;
  json["arrays"][name] = about;
  json["blocks"][name] = text;
}

void add_complex(const char* name, const std::string& text, int order, SortedJson& json) {
  add_array(name, text, {{"type", "c40"}, {"order", order}}, json);
}

}  // namespace

WorkbenchPage::WorkbenchPage(ReportData data)
    : data_(without_model(std::move(data))), light_(without_response(data_)) {}

std::shared_ptr<const Compared> WorkbenchPage::compared(ComparedResult result) {
  Compared out;
  out.result =
      report::make_comparison(data_, std::move(result.title), std::move(result.model), result.frf);
  out.response = encoded(out.result.response, 0);
  out.model_response = encoded(out.result.model_response, kSmooth);
  return std::make_shared<const Compared>(std::move(out));
}

std::string WorkbenchPage::html() const {
  const report::PageContent content = report::page_content(data_);
  return html_page(HtmlPage::workbench, data_.title, content.json, content.blocks);
}

std::string WorkbenchPage::results(const FitState& state,
                                   const std::vector<std::shared_ptr<const Compared>>& all,
                                   std::optional<std::size_t> chosen) const {
  ReportData data = light_;
  data.files.model = state.saved;
  SortedJson more = {{"stage", to_string(state.stage)},
                     {"arrays", SortedJson::object()},
                     {"blocks", SortedJson::object()},
                     {"trends", SortedJson::array()}};
  if (state.model) {
    data.model = *state.model;
    if (data_.validation_frf && state.stage == FitStage::refined)
      data.validation = validate(*state.model, *data_.validation_frf, distortion_of(*state.model));
    add_complex("model_response", encoded(response_like(*state.model, *data_.frf), kSmooth),
                kSmooth, more);
  }
  if (state.details) {
    const report::LogBytes& deviation = state.details->deviation;
    add_array("model_deviation", deviation.text,
              {{"type", "log8"}, {"low", deviation.low}, {"step", deviation.step}}, more);
    data.controller_view = state.details->loop;
  }
  for (const auto& other : all) {
    data.comparison = other->result;
    more["trends"].push_back(report::comparison_json(data));
  }
  data.comparison.reset();
  if (chosen) {
    data.comparison = all[*chosen]->result;
    add_complex("other_response", all[*chosen]->response, 0, more);
    add_complex("other_model", all[*chosen]->model_response, kSmooth, more);
  }
  std::string text = in_ascii(more);
  text.back() = ',';
  return text + "\"content\":" + report::page_content(data).json + "}";
}

}  // namespace stageid
