// Writes report.html of a synthetic stage and expected.json, the content that a browser must find.
//   report_sample DIRECTORY [full|full_compared|small|compared|bare|hostile|large|list]

#include <algorithm>
#include <complex>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/tools/report/synthetic_report.hpp"

namespace stageid {
namespace {

using Json = nlohmann::json;

/// As summaryOf() of selftest.js: channel after channel, float32 where the page has it.
class Summary {
 public:
  explicit Summary(bool floats) : floats_(floats) {}
  void add(double exact) {
    const double value = floats_ ? static_cast<double>(static_cast<float>(exact)) : exact;
    low_ = count_ == 0 ? value : std::min(low_, value);
    high_ = count_ == 0 ? value : std::max(high_, value);
    if (count_ == 0) first_ = value;
    last_ = value;
    weighted_ += value * static_cast<double>(count_ % 1009 + 1);
    ++count_;
  }
  Json json() const {
    return {{"count", count_}, {"low", low_},   {"high", high_},
            {"first", first_}, {"last", last_}, {"weighted", weighted_}};
  }

 private:
  bool floats_;
  long count_ = 0;
  double low_ = 0.0, high_ = 0.0, first_ = 0.0, last_ = 0.0, weighted_ = 0.0;
};

Json summary_of(const Eigen::MatrixXd& values, bool floats) {
  Summary out(floats);
  for (Eigen::Index c = 0; c < values.rows(); ++c)
    for (const double value : values.row(c)) out.add(value);
  return out.json();
}

Json complex_summary(const Eigen::MatrixXcd& values, bool floats) {
  Summary out(floats);
  for (Eigen::Index c = 0; c < values.rows(); ++c)
    for (const std::complex<double> value : values.row(c)) {
      out.add(value.real());
      out.add(value.imag());
    }
  return out.json();
}

/// Largest and smallest magnitude of every channel, as the large plot must show them.
Json extremes(const Eigen::MatrixXcd& values) {
  Json out = Json::array();
  for (Eigen::Index c = 0; c < values.rows(); ++c)
    out.push_back({{"low", values.row(c).cwiseAbs().minCoeff()},
                   {"high", values.row(c).cwiseAbs().maxCoeff()}});
  return out;
}

/// First and last element in the complex plane: points, model, radius of the 95 % circle
/// (|dG|^2 over a variance of nu complex degrees of freedom is F(2, 2 nu), exponential without end).
Json expected_nyquist(const ReportData& data) {
  Json out = Json::array();
  for (const Eigen::Index c : {Eigen::Index{0}, data.frf->response.rows() - 1}) {
    Json element = {{"measured", complex_summary(data.frf->response.row(c), true)}};
    if (data.model_response.size() > 0)
      element["model"] = complex_summary(data.model_response.row(c), false);
    if (data.frf->total_variance.size() > 0) {
      const double nu = data.frf->total_dof;
      const double point = nu > 0.0 ? nu * (std::pow(0.05, -1.0 / nu) - 1.0) : -std::log(0.05);
      element["radius"] =
          summary_of(std::sqrt(point) * data.frf->total_variance.row(c).cwiseSqrt(), false);
    }
    out.push_back(element);
  }
  return out;
}

Json pairs_of(Eigen::VectorXd shape) {
  shape.normalize();
  Json out = Json::array();
  for (const double value : shape) {
    out.push_back(value);
    out.push_back(0.0);
  }
  return out;
}

/// The shapes of the synthetic modes by hand: their numerators are products of two vectors.
Json expected_shapes(const AdditiveModel& model) {
  Json out = Json::array();
  for (const Submodel& submodel : model.submodels) {
    if (!submodel.is_mode()) continue;
    const Eigen::MatrixXd& b = submodel.numerator[0];
    Eigen::Index row = 0;
    Eigen::Index column = 0;
    const double most = b.cwiseAbs().maxCoeff(&row, &column);
    Eigen::VectorXd output = b.col(column);
    for (const double value : b.col(column)) {
      if (std::abs(value) < 0.9 * most) continue;
      if (value < 0.0) output = -output;
      break;
    }
    out.push_back({{"outputs", pairs_of(output)}, {"inputs", pairs_of(b.transpose() * output)}});
  }
  return out;
}

Json expected_comparison(const ReportData& data) {
  Json pairs = Json::array();
  int own = 0;
  for (const Submodel& submodel : data.model->submodels) {
    if (!submodel.is_mode()) continue;
    const double f = submodel.natural_frequency_hz();
    if (own > 0)
      pairs.push_back(
          {{"own", own},
           {"other", own - 1},
           {"frequency_difference", test::kOtherDayShift},
           {"frequency_deviation",
            test::kOtherDayShift * f / (std::sqrt(2.0) * *submodel.natural_frequency_std_hz)}});
    ++own;
  }
  return {{"pairs", pairs},
          {"other", extremes(data.comparison->response)},
          {"otherModel", extremes(data.comparison->model_response)},
          {"change", extremes(data.comparison->response - data.frf->response)}};
}

Json expected(const ReportData& data) {
  Json out = {{"title", data.title}, {"modes", data.model ? data.true_modes.size() : 0}};
  RunTiming timing;
  for (const LogRun& run : data.runs) timing += run.timing;
  if (data.model) out["shapes"] = expected_shapes(*data.model);
  out["places"] = data.geometry.actuators.size() + data.geometry.sensors.size();
  out["timed_cycles"] = timing.lateness.total() + timing.execution.total();
  if (!data.frf) return out;
  const FrfEstimate& frf = *data.frf;
  if (data.comparison) {
    out["comparison"] = expected_comparison(data);
    out["arrays"]["other_response"] = complex_summary(data.comparison->response, false);
    out["arrays"]["other_model"] = complex_summary(data.comparison->model_response, false);
  }
  out["stabilization"] = Json::array();
  for (const StabilizationPole& pole : data.stabilization)
    out["stabilization"].push_back(
        {pole.order, pole.frequency_hz, pole.damping_ratio,
         pole.stable_damping ? 2 : static_cast<int>(pole.stable_frequency)});
  out["findings"] = data.findings.size();
  out["loops"] = data.controller_view.empty() ? 0 : 2;
  out["distorted"] = data.nonlinearity ? 1 : 0;
  out["panels"] = frf.response.rows();
  out["lines"] = frf.lines();
  out["shape"] = {frf.n_outputs(), frf.n_inputs()};
  out["measured"] = extremes(frf.response);
  out["nyquist"] = expected_nyquist(data);
  out["arrays"]["frequency"] = summary_of(frf.frequency_hz.transpose(), false);
  out["arrays"]["response"] = complex_summary(frf.response, true);
  if (frf.interpolation_misfit.size() > 0) {
    Eigen::Index worst = 0;
    frf.interpolation_misfit.maxCoeff(&worst);
    out["arrays"]["interpolation_misfit"] = summary_of(frf.interpolation_misfit.transpose(), true);
    out["correlated"] = {
        {"independent", std::lround(static_cast<double>(frf.lines()) / frf.correlated_lines)},
        {"largest", frf.interpolation_misfit[worst]},
        {"at_hz", frf.frequency_hz[worst]}};
  }
  if (data.model_response.size() > 0) {
    out["arrays"]["residual"] = complex_summary(frf.response - data.model_response, false);
    out["model"] = extremes(data.model_response);
  }
  if (frf.total_variance.size() > 0)
    out["arrays"]["deviation"] = summary_of(frf.total_variance.cwiseSqrt(), false);
  if (data.cmif_curves.size() > 0) out["arrays"]["cmif"] = summary_of(data.cmif_curves, true);
  return out;
}

/// As of a zippered experiment: correlated lines, and a resonance too narrow for them.
void make_zippered(FrfEstimate& frf) {
  frf.correlated_lines = 6.5;
  frf.interpolation_misfit = Eigen::VectorXd::LinSpaced(frf.lines(), 0.8, 1.2);
  frf.interpolation_misfit[frf.lines() / 3] = 74.5;
}

/// Every text that comes from outside tries to become an element.
void make_hostile(ReportData& data) {
  const std::string attack = "</script><img src=x onerror=\"console.error('injected')\">&amp;<!--";
  data.title = attack;
  data.frf->inputs.names[0] = attack;
  data.frf->inputs.units[0] = attack;
  data.frf->outputs.names[0] = "z\xff\xc0 {{content}} " + attack;
  test::add_other_day(data);
  data.comparison->title = attack;
  for (Finding& finding : data.findings)
    finding.channel = finding.what = finding.figure = finding.remedy = attack;
  data.model->inputs.names[0] = attack;
  data.geometry.actuators[0].name = attack;
  data.validation_frf->inputs = data.frf->inputs;
  data.validation_frf->outputs = data.frf->outputs;
  data.model->provenance_json = Json({{"decisions", Json::array({attack})}}).dump();
  data.documents.push_back({attack, attack});
  data.frf->provenance_json = attack;
  Json view = Json::parse(data.controller_view);
  view["loops"][0]["name"] = attack;
  data.controller_view = view.dump();
  data.figures.push_back({attack, attack});
  data.doubts.push_back(attack);
  data.notes.push_back(attack);
  data.steps.push_back({attack, 1.0, attack});
  data.runs[0].name = attack;
  data.runs[0].started_utc = attack;
  data.model->fit.weighting = attack;
}

ReportData sample(const std::string& kind) {
  if (kind == "full" || kind == "full_compared") {
    ReportData data = test::synthetic_report({.variance_dof = 7});
    if (kind == "full_compared") test::add_other_day(data);
    return data;
  }
  if (kind == "bare") {  // a measurement of a response, no variances, no model
    ReportData data = test::synthetic_report({.outputs = 1, .inputs = 2, .lines = 60, .modes = 2});
    ReportData bare;
    bare.title = "Bare response";
    bare.frf = data.frf;
    bare.frf->total_variance.resize(0, 0);
    bare.frf->noise_variance.resize(0, 0);
    return bare;
  }
  if (kind == "large")  // the largest matrix of panels
    return test::synthetic_report({.outputs = 50, .inputs = 50, .lines = 1000});
  if (kind == "list")  // too many sensors for panels
    return test::synthetic_report({.outputs = 400, .inputs = 10, .lines = 500});
  ReportData data = test::synthetic_report({.outputs = 2, .inputs = 3, .lines = 300, .modes = 5});
  if (kind == "small") {
    data.geometry = {};  // shapes as bars
    make_zippered(*data.frf);
  }
  if (kind == "compared") test::add_other_day(data);
  if (kind == "hostile") make_hostile(data);
  return data;
}

}  // namespace
}  // namespace stageid

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: report_sample DIRECTORY "
                 "[full|full_compared|small|compared|bare|hostile|large|list]\n";
    return 2;
  }
  const std::filesystem::path directory = argv[1];
  std::filesystem::create_directories(directory);
  const stageid::ReportData data = stageid::sample(argc > 2 ? argv[2] : "full");
  stageid::write_report(directory / "report.html", data);
  std::ofstream(directory / "expected.json")
      << stageid::expected(data).dump(1, ' ', true, nlohmann::json::error_handler_t::replace);
}
