#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "acquisition/files/output_file.hpp"
#include "estimation/file/json_file.hpp"
#include "estimation/modal/mode_shapes.hpp"
#include "estimation/model/additive_model.hpp"

namespace stageid {
namespace {

using Json = nlohmann::ordered_json;

Json matrix_to_json(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index y = 0; y < matrix.rows(); ++y) {
    Json row = Json::array();
    for (Eigen::Index u = 0; u < matrix.cols(); ++u) row.push_back(matrix(y, u));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Real parts under `name`, imaginary ones under a separate key if the mode has them.
void add_shape(const std::string& name, const Eigen::VectorXcd& shape,
               const Eigen::VectorXcd& deviation, bool complex, Json& out) {
  const auto add = [&](const std::string& key, const Eigen::VectorXd& values) {
    out[key] = std::vector<double>(values.begin(), values.end());
  };
  add(name, shape.real());
  add(name + "_std", deviation.real());
  if (!complex) return;
  add(name + "_imaginary", shape.imag());
  add(name + "_imaginary_std", deviation.imag());
}

/// Shapes and mass follow from the numerators; they are stored together with their standard deviations.
void add_shapes(const Submodel& s, Json& out) {
  if (!s.is_mode() || !s.shape_std) return;
  const ModeShape mode = mode_shape(s, 0);
  const bool complex = s.numerator.size() > 1;
  out["modal_mass"] = mode.modal_mass;
  out["modal_mass_std"] = s.shape_std->modal_mass;
  add_shape("output_shape", mode.output_shape, s.shape_std->output_shape, complex, out);
  add_shape("input_shape", mode.input_shape, s.shape_std->input_shape, complex, out);
}

void add_pole(const PoleEstimate& pole, Json& out) {
  out["natural_frequency_hz"] = pole.natural_frequency_hz;
  out["damping_ratio"] = pole.damping_ratio;
  if (pole.natural_frequency_std_hz)
    out["natural_frequency_std_hz"] = *pole.natural_frequency_std_hz;
  if (pole.damping_ratio_std) out["damping_ratio_std"] = *pole.damping_ratio_std;
}

/// Unknown values are NaN, which is written as null.
Json submodel_to_json(const Submodel& s) {
  Json out;
  out["integrators"] = s.integrators;
  out["denominator"] = s.denominator;
  out["numerator"] = Json::array();
  for (const Eigen::MatrixXd& B : s.numerator) out["numerator"].push_back(matrix_to_json(B));
  for (const Eigen::MatrixXd& std : s.numerator_std)
    out["numerator_std"].push_back(matrix_to_json(std));
  if (s.is_mode()) {
    add_pole({s.natural_frequency_hz(), s.damping_ratio(), s.natural_frequency_std_hz,
              s.damping_ratio_std},
             out);
    if (s.verdict) out["verdict"] = to_string(*s.verdict);
    add_shapes(s, out);
  }
  for (const PoleEstimate& pole : s.poles) {
    Json item;
    add_pole(pole, item);
    out["poles"].push_back(std::move(item));
  }
  if (s.residue_rank) out["residue_rank"] = *s.residue_rank;
  return out;
}

std::vector<double> to_list(const Eigen::VectorXd& values, Eigen::Index size) {
  if (values.size() == 0) return std::vector<double>(size, 0.0);
  return {values.begin(), values.end()};
}

Eigen::MatrixXd matrix_from_json(const JsonNode& node, std::size_t rows, std::size_t columns,
                                 bool or_null = false) {
  Eigen::MatrixXd out(rows, columns);
  const std::vector<JsonNode> lines = node.elements();
  if (lines.size() != rows)
    node.fail("must have " + std::to_string(rows) + " rows, one per output");
  for (std::size_t y = 0; y < rows; ++y) {
    const std::vector<double> values = or_null ? lines[y].numbers_or_null() : lines[y].numbers();
    if (values.size() != columns)
      lines[y].fail("must have " + std::to_string(columns) + " numbers, one per input");
    for (std::size_t u = 0; u < columns; ++u)
      out(static_cast<Eigen::Index>(y), static_cast<Eigen::Index>(u)) = values[u];
  }
  return out;
}

PoleEstimate pole_from_json(const JsonNode& node) {
  return {node.member("natural_frequency_hz").positive(), node.member("damping_ratio").number(),
          node.optional_number("natural_frequency_std_hz"),
          node.optional_number("damping_ratio_std")};
}

/// numerator_std: as many matrices as `numerator`, no negative entries.
std::vector<Eigen::MatrixXd> deviations_from_json(const JsonNode& node,
                                                  const std::vector<Eigen::MatrixXd>& numerator) {
  const JsonNode list = node.member("numerator_std");
  std::vector<Eigen::MatrixXd> out;
  for (const JsonNode& matrix : list.elements()) {
    out.push_back(matrix_from_json(matrix, static_cast<std::size_t>(numerator[0].rows()),
                                   static_cast<std::size_t>(numerator[0].cols()), true));
    if ((out.back().array() < 0.0).any())
      matrix.fail("must not contain a negative standard deviation");
  }
  if (out.size() != numerator.size()) list.fail("must have as many matrices as \"numerator\"");
  return out;
}

Eigen::VectorXcd shape_deviation_from_json(const JsonNode& node, const std::string& name,
                                           Eigen::Index size) {
  Eigen::VectorXcd out = Eigen::VectorXcd::Zero(size);
  const auto read = [&](const std::string& key) {
    const std::vector<double> values = node.member(key).numbers();
    if (std::ssize(values) != size)
      node.member(key).fail("must have " + std::to_string(size) + " numbers, one per channel");
    if (*std::ranges::min_element(values) < 0.0)
      node.member(key).fail("must not contain a negative standard deviation");
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(values.data(), size));
  };
  out.real() = read(name + "_std");
  if (node.has(name + "_imaginary_std")) out.imag() = read(name + "_imaginary_std");
  return out;
}

/// The shapes themselves are not read, because they follow from the numerators.
std::optional<ModeShapeDeviation> shape_deviations_from_json(
    const JsonNode& node, const std::vector<Eigen::MatrixXd>& numerator) {
  if (!node.has("modal_mass_std")) return std::nullopt;
  return ModeShapeDeviation{shape_deviation_from_json(node, "output_shape", numerator[0].rows()),
                            shape_deviation_from_json(node, "input_shape", numerator[0].cols()),
                            node.member("modal_mass_std").number()};
}

/// A value that the file repeats for its readers. Changed by hand, it would have no effect.
void check_follows(const JsonNode& node, const std::string& key, double value) {
  constexpr double kRounded = 1e-3;  // by hand or by another program
  const std::optional<double> given = node.optional_number(key);
  if (given && std::abs(*given - value) > kRounded * std::abs(value))
    node.member(key).fail(fmt::format(
        "contradicts \"denominator\", which gives {:.7g}: change the coefficients, or remove this "
        "key",
        value));
}

Submodel submodel_from_json(const JsonNode& node, std::size_t n_outputs, std::size_t n_inputs) {
  Submodel s;
  s.integrators = static_cast<int>(node.member("integrators").integer(0, 2));
  s.denominator = node.member("denominator").numbers();
  if (s.denominator.empty() || s.denominator[0] != 1.0)
    node.member("denominator").fail("must start with 1");
  if (s.denominator.size() > 1 && s.denominator.back() == 0.0)
    node.member("denominator").fail("must not end with 0");
  for (const JsonNode& matrix : node.member("numerator").elements())
    s.numerator.push_back(matrix_from_json(matrix, n_outputs, n_inputs));
  if (s.numerator.empty()) node.member("numerator").fail("must contain at least one matrix");
  if (s.numerator.size() > s.denominator.size() + static_cast<std::size_t>(s.integrators))
    node.member("numerator")
        .fail("has a higher degree than the denominator: the submodel is improper");
  if (s.is_mode()) {
    check_follows(node, "natural_frequency_hz", s.natural_frequency_hz());
    check_follows(node, "damping_ratio", s.damping_ratio());
  }
  s.natural_frequency_std_hz = node.optional_number("natural_frequency_std_hz");
  s.damping_ratio_std = node.optional_number("damping_ratio_std");
  if (node.has("verdict")) s.verdict = from_word<ModeVerdict>(node.member("verdict").text());
  if (node.has("poles"))
    for (const JsonNode& pole : node.member("poles").elements())
      s.poles.push_back(pole_from_json(pole));
  if (node.has("numerator_std")) s.numerator_std = deviations_from_json(node, s.numerator);
  s.shape_std = shape_deviations_from_json(node, s.numerator);
  if (node.has("residue_rank"))
    s.residue_rank = static_cast<int>(node.member("residue_rank").integer(1, 1'000'000));
  return s;
}

HoldModel hold_from_text(const JsonNode& node) {
  if (const auto hold = from_word<HoldModel>(node.text())) return *hold;
  node.fail("must be " + one_of(kWords<HoldModel>));
}

Eigen::VectorXd delays_from_json(const JsonNode& root, const std::string& key, std::size_t size) {
  if (!root.has(key)) return Eigen::VectorXd::Zero(static_cast<Eigen::Index>(size));
  const std::vector<double> values = root.member(key).numbers();
  if (values.size() != size)
    root.member(key).fail("must have " + std::to_string(size) + " numbers, one per channel");
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(size));
}

/// Empty if the file has none.
Eigen::VectorXd delay_deviations_from_json(const JsonNode& root, const std::string& key,
                                           std::size_t size) {
  if (!root.has(key)) return {};
  Eigen::VectorXd out = delays_from_json(root, key, size);
  if (out.minCoeff() < 0.0) root.member(key).fail("must not contain a negative standard deviation");
  return out;
}

FitRecord fit_from_json(const JsonNode& node) {
  FitRecord fit;
  fit.cost = node.number_or("cost", 0.0);
  fit.weighting = node.text_or_empty("weighting");
  if (node.has("iterations"))
    fit.iterations = static_cast<int>(node.member("iterations").integer(0, 1'000'000'000));
  if (const std::string word = node.text_or_empty("status"); !word.empty()) {
    fit.status = from_word<FitStatus>(word);
    if (!fit.status)
      node.member("status").fail(
          fmt::format("must be one of {}", fmt::join(words_of<FitStatus>(), ", ")));
  }
  fit.message = node.text_or_empty("message");
  for (const JsonNode& reason : node.elements_of("reasons")) {
    const auto status = from_word<FitStatus>(reason.text_or_empty("status"));
    fit.reasons.push_back({status.value_or(fit.status.value_or(FitStatus::unexplained)),
                           reason.text_or_empty("what"), reason.text_or_empty("remedy"),
                           reason.text_or_empty("flags")});
  }
  fit.relative_rms_error =
      node.number_or("relative_rms_error", std::numeric_limits<double>::quiet_NaN());
  if (node.has("band_hz")) {
    const std::vector<double> band = node.member("band_hz").numbers();
    if (band.size() != 2) node.member("band_hz").fail("must be two frequencies");
    fit.band_hz[0] = band[0];
    fit.band_hz[1] = band[1];
  }
  fit.seconds = node.number_or("seconds", 0.0);
  return fit;
}

ChannelList channels_from_json(const JsonNode& root, const std::string& key) {
  ChannelList out;
  out.names = root.member(key).texts();
  if (out.names.empty()) root.member(key).fail("must name at least one channel");
  const std::string units = key.substr(0, key.size() - 1) + "_units";
  if (root.has(units)) out.units = root.member(units).texts();
  out.units.resize(out.names.size());
  return out;
}

/// JSON as a file has it, within so many levels.
std::string in_lines(const Json& json, std::size_t levels) {
  const std::string text = json.dump(1, ' ', false, Json::error_handler_t::replace);
  std::string out;
  for (const char c : text) {
    out += c;
    if (c == '\n') out.append(levels, ' ');
  }
  return out;
}

}  // namespace

void write_model(const std::filesystem::path& file, const AdditiveModel& model) {
  Json root;
  root["format"] = "stageid-model";
  root["format_version"] = 1;
  root["inputs"] = model.inputs.names;
  root["outputs"] = model.outputs.names;
  root["input_units"] = model.inputs.units;
  root["output_units"] = model.outputs.units;
  root["sample_rate_hz"] = model.sample_rate_hz;
  root["hold"] = to_string(model.hold);
  root["input_delay_s"] = to_list(model.input_delay_s, model.n_inputs());
  root["output_delay_s"] = to_list(model.output_delay_s, model.n_outputs());
  if (model.input_delay_std_s.size() > 0) {
    root["input_delay_std_s"] = to_list(model.input_delay_std_s, model.n_inputs());
    root["output_delay_std_s"] = to_list(model.output_delay_std_s, model.n_outputs());
  }
  root["submodels"] = Json::array();
  root["fit"] = {{"cost", model.fit.cost},
                 {"weighting", model.fit.weighting},
                 {"iterations", model.fit.iterations},
                 {"status", model.fit.status_word()},
                 {"band_hz", {model.fit.band_hz[0], model.fit.band_hz[1]}},
                 {"seconds", model.fit.seconds}};
  if (!model.fit.trustworthy() && !model.fit.message.empty())
    root["fit"]["message"] = model.fit.message;
  for (const FitReason& reason : model.fit.reasons)
    root["fit"]["reasons"].push_back({{"status", to_string(reason.status)},
                                      {"what", reason.what},
                                      {"remedy", reason.remedy},
                                      {"flags", reason.flags}});
  if (std::isfinite(model.fit.relative_rms_error))
    root["fit"]["relative_rms_error"] = model.fit.relative_rms_error;
  root["cost_history"] = model.cost_history;
  root["provenance"] = Json::parse(model.provenance_json);

  // One submodel at a time: as JSON, those of a million channels would take gigabytes.
  const std::string around = in_lines(root, 0) + "\n";
  const std::string list = "\n \"submodels\": [";  // in texts, the end of a line is escaped
  const std::size_t place = around.find(list) + list.size();
  OutputFile out(file);
  out.append(around.substr(0, place));
  const char* before = "\n  ";
  for (const Submodel& s : model.submodels) {
    out.append(before + in_lines(submodel_to_json(s), 2));
    before = ",\n  ";
  }
  out.append((model.submodels.empty() ? "" : "\n ") + around.substr(place));
  out.commit();
}

AdditiveModel read_model(const std::filesystem::path& file) {
  const JsonFile json(file, "stageid-model");
  const JsonNode root = json.root();
  if (root.has("format_version")) root.member("format_version").integer(1, 1);
  AdditiveModel model;
  model.inputs = channels_from_json(root, "inputs");
  model.outputs = channels_from_json(root, "outputs");
  model.sample_rate_hz = root.number_or("sample_rate_hz", 0.0);
  if (model.sample_rate_hz < 0.0)
    root.member("sample_rate_hz").fail("must be 0 or more (0: unknown)");
  model.hold = root.has("hold") ? hold_from_text(root.member("hold")) : HoldModel::none;
  model.input_delay_s = delays_from_json(root, "input_delay_s", model.inputs.size());
  model.output_delay_s = delays_from_json(root, "output_delay_s", model.outputs.size());
  model.input_delay_std_s =
      delay_deviations_from_json(root, "input_delay_std_s", model.inputs.size());
  model.output_delay_std_s =
      delay_deviations_from_json(root, "output_delay_std_s", model.outputs.size());
  for (const JsonNode& node : root.member("submodels").elements())
    model.submodels.push_back(submodel_from_json(node, model.outputs.size(), model.inputs.size()));
  if (root.has("fit")) model.fit = fit_from_json(root.member("fit"));
  if (root.has("cost_history")) model.cost_history = root.member("cost_history").numbers();
  if (root.has("provenance")) model.provenance_json = root.member("provenance").raw().dump();
  return model;
}

}  // namespace stageid
