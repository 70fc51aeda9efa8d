#include "tools/steps/fit_step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/files/version.hpp"
#include "tools/steps/problem.hpp"
#include "tools/terminal/interrupt.hpp"

namespace stageid {
namespace {

Json distortion_json(const Distortion& distortion) {
  Json bands = Json::array();
  for (Eigen::Index b = 0; b < distortion.band_hz.rows(); ++b) {
    bands.push_back({{"band_hz", {distortion.band_hz(b, 0), distortion.band_hz(b, 1)}},
                     {"level", Eigen::VectorXd(distortion.level.col(b))}});
  }
  return bands;
}

std::string provenance(const FitSetup& setup, const FitResult& result, const std::string& frf_name,
                       const std::string& frf_fingerprint, const std::vector<Problem>& problems) {
  Json json;
  json["stageid_version"] = version();
  json["made_by"] = "fit";
  json["request_id"] = fit_request_id(setup, frf_fingerprint);
  json["inputs"] = {{{"file", frf_name}, {"fingerprint", frf_fingerprint}}};
  json["options"] = Json::parse(setup.request_json);
  json["decisions"] = result.decisions;
  if (!problems.empty()) json["problems"] = stored(problems);
  if (setup.distortion.band_hz.size() > 0) json["distortion"] = distortion_json(setup.distortion);
  json["frf"] = parse_json_object<Json>(setup.frf.provenance_json);
  return json_line(json);
}

std::string optional_number(const std::optional<double>& value) {
  return value ? fmt::format("{:.2g}", *value) : "-";
}

/// Rounded to two digits of the deviation.
std::string with_deviation(double value, double deviation) {
  if (!(deviation > 0.0)) return fmt::format("{:.6g} +- 0", value);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(deviation))), 0, 12);
  return fmt::format("{:.{}f} +- {:.{}f}", value, decimals, deviation, decimals);
}

/// A mode has its own pole; those of other submodels are from the fit.
std::vector<PoleEstimate> poles_of(const Submodel& s) {
  if (!s.is_mode()) return s.poles;
  return {{s.natural_frequency_hz(), s.damping_ratio(), s.natural_frequency_std_hz,
           s.damping_ratio_std}};
}

std::vector<std::string> texts_in(const Json& object, const char* key) {
  std::vector<std::string> texts;
  for (const Json& text : list_in(object, key))
    if (text.is_string()) texts.push_back(text.get<std::string>());
  return texts;
}

}  // namespace

std::string fit_request_id(const FitSetup& setup, const std::string& frf_fingerprint) {
  return fingerprint_of(fmt::format("{} {} {}", version(), frf_fingerprint, setup.request_json));
}

FitResult complete_fit(const FitSetup& setup, const FitOptions& options,
                       const std::string& frf_name, const std::string& frf_fingerprint) {
  FitResult result = fit_model(setup, options);
  std::vector<Problem> problems = problems_of(setup.frf);
  rank(problems);
  for (const Problem& problem : problems)
    if (problem.grave)
      result.model.fit.distrust({FitStatus::faulty_data, problem.what, problem.remedy});
  result.model.provenance_json = provenance(setup, result, frf_name, frf_fingerprint, problems);
  return result;
}

FitStep fit_with_progress(const FitSetup& setup, const std::string& frf_name,
                          const std::string& frf_fingerprint, const Console& console) {
  FitStep step;
  FitOptions options = setup.options;
  Progress progress(console, "fit", "iterations");
  throw_if_interrupted();
  const ControlledStop keeps_the_best_model;
  // A signal may reach the processes of a team at different steps.
  options.interrupted = [&] { return console.team->any(interrupt_flag()); };
  options.progress = [&](int iteration, double cost) {
    progress.update(iteration, 0.0, fmt::format("cost {:.6g}", cost));
  };
  step.result = complete_fit(setup, options, frf_name, frf_fingerprint);
  step.seconds = progress.seconds();
  return step;
}

std::vector<std::string> findings_beside_message(const FitResult& result) {
  std::vector<std::string> findings = result.findings;
  if (!result.trustworthy())
    std::erase_if(findings, [&](const std::string& finding) {
      return result.message().find(finding) != std::string::npos;
    });
  return findings;
}

Distortion distortion_of(const AdditiveModel& model) {
  const Json bands = list_in(parse_json<Json>(model.provenance_json), "distortion");
  const Eigen::Index channels = model.n_outputs() * model.n_inputs();
  Distortion out;
  const auto count = std::ssize(bands);
  out.band_hz.resize(count, 2);
  out.level.resize(channels, count);
  for (Eigen::Index b = 0; b < count; ++b) {
    const Json& band = bands[b];
    const std::vector<double> edges = numbers_in(band, "band_hz");
    const std::vector<double> level = numbers_in(band, "level");
    if (edges.size() != 2 || std::ssize(level) != channels) return {};
    out.band_hz.row(b) << edges[0], edges[1];
    out.level.col(b) = Eigen::Map<const Eigen::VectorXd>(level.data(), channels);
  }
  return out;
}

std::vector<std::string> decisions_of(const AdditiveModel& model) {
  return texts_in(parse_json<Json>(model.provenance_json), "decisions");
}

std::string relative_error_text(const FitRecord& fit) {
  return std::isfinite(fit.relative_rms_error)
             ? fmt::format("relative error {:.4g}", fit.relative_rms_error)
             : "no channel exceeds its noise";
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

std::vector<std::string> delay_lines(const AdditiveModel& model) {
  const bool known = model.input_delay_std_s.size() > 0;
  const Eigen::VectorXd inputs = model.input_delays_s();
  const Eigen::VectorXd outputs = model.output_delays_s();
  const auto line = [&](const std::string& of, double delay_s, const Eigen::VectorXd& std_s,
                        Eigen::Index at) {
    return known ? fmt::format("delay{} {} us", of, with_deviation(1e6 * delay_s, 1e6 * std_s[at]))
                 : fmt::format("delay{} {:.6g} us", of, 1e6 * delay_s);
  };
  if (inputs.isConstant(inputs[0], 0.0) && outputs.isZero(0.0) &&
      (!known || model.input_delay_std_s.isConstant(model.input_delay_std_s[0], 0.0))) {
    if (!known && inputs[0] == 0.0) return {};
    return {line("", inputs[0], model.input_delay_std_s, 0)};
  }
  std::vector<std::string> lines;
  for (Eigen::Index u = 0; u < inputs.size(); ++u)
    lines.push_back(line(fmt::format(" of input {}", model.inputs.name(u)), inputs[u],
                         model.input_delay_std_s, u));
  for (Eigen::Index y = 0; y < outputs.size(); ++y) {
    const std::string& name = model.outputs.name(y);
    if (y + 1 == outputs.size() && outputs[y] == 0.0)
      lines.push_back(fmt::format("delay of output {} 0 us, the reference", name));
    else
      lines.push_back(line(" of output " + name, outputs[y], model.output_delay_std_s, y));
  }
  return lines;
}

Json delays_json(const AdditiveModel& model) {
  Json json = Json::object();
  const auto add = [&json](const char* key, const Eigen::VectorXd& values) {
    if (values.size() > 0) json[key] = values;
  };
  add("input_delay_s", model.input_delays_s());
  add("output_delay_s", model.output_delays_s());
  add("input_delay_std_s", model.input_delay_std_s);
  add("output_delay_std_s", model.output_delay_std_s);
  return json;
}

std::string cost_line(const std::vector<double>& cost) {
  if (cost.empty()) return "cost: no iteration";
  if (cost.size() == 1) return fmt::format("cost: {:.6g}", cost.front());
  return fmt::format("cost: {:.6g} -> {:.6g} in {} iterations", cost.front(), cost.back(),
                     cost.size() - 1);
}

Json modes_json(const AdditiveModel& model) {
  Json list = Json::array();
  for (const Submodel& s : model.submodels)
    if (s.is_mode())
      list.push_back({{"natural_frequency_hz", s.natural_frequency_hz()},
                      {"natural_frequency_std_hz", or_null(s.natural_frequency_std_hz)},
                      {"damping_ratio", s.damping_ratio()},
                      {"damping_ratio_std", or_null(s.damping_ratio_std)}});
  return list;
}

}  // namespace stageid
