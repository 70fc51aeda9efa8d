#include "tools/model_export.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <complex>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "excitation/file_error.hpp"
#include "excitation/hdf5_file.hpp"
#include "excitation/output_file.hpp"

namespace stageid {
namespace {

enum class Format { json, hdf5, csv };

Format format_of(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".json") return Format::json;
  if (ending == ".h5" || ending == ".hdf5") return Format::hdf5;
  if (ending == ".csv") return Format::csv;
  throw std::invalid_argument(fmt::format(
      "{}: models are not exported as '{}'; there are .json, .h5 and .csv", file.string(), ending));
}

hsize_t size_of(Eigen::Index n) { return static_cast<hsize_t>(n); }

/// [N x n_y x n_u] in C order from columns that are vec of an n_y x n_u matrix.
template <typename Scalar>
std::vector<Scalar> c_order(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& columns,
                            Eigen::Index n_y) {
  std::vector<Scalar> data;
  data.reserve(static_cast<std::size_t>(columns.size()));
  const Eigen::Index n_u = columns.rows() / n_y;
  for (Eigen::Index k = 0; k < columns.cols(); ++k)
    for (Eigen::Index i = 0; i < n_y; ++i)
      for (Eigen::Index j = 0; j < n_u; ++j) data.push_back(columns(i + n_y * j, k));
  return data;
}

void write_submodels(Hdf5File& file, const AdditiveModel& model) {
  file.create_group("/submodels");
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    const std::string group = fmt::format("/submodels/{:04}", index);
    file.create_group(group);
    file.write_attribute(group, "integrators", static_cast<long long>(s.integrators));
    file.write_reals(group + "/denominator", {s.denominator.size()}, s.denominator.data());
    std::vector<double> numerator;
    for (const Eigen::MatrixXd& B : s.numerator)
      for (Eigen::Index i = 0; i < B.rows(); ++i)
        for (Eigen::Index j = 0; j < B.cols(); ++j) numerator.push_back(B(i, j));
    file.write_reals(group + "/numerator",
                     {s.numerator.size(), size_of(model.n_outputs()), size_of(model.n_inputs())},
                     numerator.data());
  }
}

void write_modes_table(Hdf5File& file, const AdditiveModel& model) {
  std::vector<double> frequency_hz, damping, frequency_std_hz, damping_std;
  std::vector<long long> submodel;
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    if (!s.is_mode()) continue;
    frequency_hz.push_back(s.natural_frequency_hz());
    damping.push_back(s.damping_ratio());
    frequency_std_hz.push_back(s.natural_frequency_std_hz.value_or(std::nan("")));
    damping_std.push_back(s.damping_ratio_std.value_or(std::nan("")));
    submodel.push_back(static_cast<long long>(index));
  }
  file.create_group("/modes");
  const std::vector<hsize_t> shape = {submodel.size()};
  file.write_reals("/modes/natural_frequency_hz", shape, frequency_hz.data());
  file.write_reals("/modes/damping_ratio", shape, damping.data());
  file.write_reals("/modes/natural_frequency_std_hz", shape, frequency_std_hz.data());
  file.write_reals("/modes/damping_ratio_std", shape, damping_std.data());
  file.write_integers("/modes/submodel", shape, submodel.data());
}

std::string model_text(const AdditiveModel& model, const std::filesystem::path& beside) {
  // write_model() writes files only; its text goes through one beside the target.
  const OutputFile scratch(beside.string() + ".json");
  const std::filesystem::path file = scratch.path();
  write_model(file, model);
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

void write_hdf5(const std::filesystem::path& target, const AdditiveModel& model,
                const ExportedResponse& exported) {
  OutputFile output(target);
  Hdf5File file = Hdf5File::create(output.path());
  file.write_attribute("/", "format", std::string("stageid-model"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "sample_rate_hz", model.sample_rate_hz);
  file.write_attribute("/", "hold", std::string(to_string(model.hold)));
  file.write_texts("/inputs", model.inputs.names);
  file.write_attribute("/inputs", "unit", model.inputs.units);
  file.write_texts("/outputs", model.outputs.names);
  file.write_attribute("/outputs", "unit", model.outputs.units);
  const Eigen::VectorXd input_delay = model.input_delay_s.size() > 0
                                          ? model.input_delay_s
                                          : Eigen::VectorXd::Zero(model.n_inputs());
  const Eigen::VectorXd output_delay = model.output_delay_s.size() > 0
                                           ? model.output_delay_s
                                           : Eigen::VectorXd::Zero(model.n_outputs());
  file.write_reals("/input_delay_s", {size_of(input_delay.size())}, input_delay.data());
  file.write_reals("/output_delay_s", {size_of(output_delay.size())}, output_delay.data());
  file.write_texts("/model_json", {model_text(model, target)});
  write_submodels(file, model);
  write_modes_table(file, model);
  if (exported.frequency_hz.size() > 0) {
    const hsize_t N = size_of(exported.frequency_hz.size());
    const std::vector<hsize_t> shape = {N, size_of(model.n_outputs()), size_of(model.n_inputs())};
    file.write_reals("/frequency_hz", {N}, exported.frequency_hz.data());
    const Eigen::MatrixXcd P = response(model, exported.frequency_hz, model.hold);
    file.write_complex("/response", shape,
                       c_order<std::complex<double>>(P, model.n_outputs()).data());
    if (exported.variance.size() > 0)
      file.write_reals("/response_variance", shape,
                       c_order<double>(exported.variance, model.n_outputs()).data());
  }
  file.close();
  output.commit();
}

/// A field of a CSV file, quoted if it must be.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string number_or_nothing(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : "";
}

std::string csv_text(const AdditiveModel& model) {
  std::string text = fmt::format(
      "# stageid-model 1, written by stageid {}; hold {}, sample rate {} Hz\n"
      "# P(s) = sum over submodels of coefficient s^power_of_s / (s^integrators A(s)), SI units, s "
      "in "
      "rad/s\n"
      "# A(s) = 1 + 2 zeta s/omega + s^2/omega^2, or 1 where natural_frequency_hz is empty\n"
      "submodel,integrators,natural_frequency_hz,natural_frequency_std_hz,damping_ratio,"
      "damping_ratio_std,power_of_s,output,input,coefficient\n",
      STAGEID_VERSION, to_string(model.hold), model.sample_rate_hz);
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    if (s.denominator.size() > 1 && !s.is_mode())
      throw std::invalid_argument(fmt::format(
          "submodel {} is no mode and no integrator; the .csv table cannot hold it, export "
          "as .json or .h5",
          index));
    const std::string head =
        s.is_mode()
            ? fmt::format("{},{},{},{},{},{}", index, s.integrators, s.natural_frequency_hz(),
                          number_or_nothing(s.natural_frequency_std_hz), s.damping_ratio(),
                          number_or_nothing(s.damping_ratio_std))
            : fmt::format("{},{},,,,", index, s.integrators);
    for (std::size_t power = 0; power < s.numerator.size(); ++power)
      for (Eigen::Index i = 0; i < model.n_outputs(); ++i)
        for (Eigen::Index j = 0; j < model.n_inputs(); ++j)
          text += fmt::format("{},{},{},{},{}\n", head, power,
                              field(model.outputs.names[static_cast<std::size_t>(i)]),
                              field(model.inputs.names[static_cast<std::size_t>(j)]),
                              s.numerator[power](i, j));
  }
  return text;
}

}  // namespace

void require_export_format(const std::filesystem::path& file) {
  static_cast<void>(format_of(file));
}

void export_model(const std::filesystem::path& file, const AdditiveModel& model,
                  const ExportedResponse& response) {
  switch (format_of(file)) {
    case Format::json:
      write_model(file, model);
      return;
    case Format::hdf5:
      write_hdf5(file, model, response);
      return;
    case Format::csv:
      write_text_file(file, csv_text(model));
      return;
  }
}

Eigen::MatrixXd read_response_variance(const std::filesystem::path& path,
                                       const Eigen::VectorXd& frequency_hz) {
  const Hdf5File file = Hdf5File::open(path);
  if (!file.exists("/response_variance") || !file.exists("/frequency_hz")) return {};
  const std::vector<double> lines = file.read_reals("/frequency_hz");
  if (!std::equal(lines.begin(), lines.end(), frequency_hz.begin(), frequency_hz.end())) return {};
  const std::vector<hsize_t> shape = file.shape("/response_variance");
  if (shape.size() != 3 || shape[0] != lines.size()) return {};
  const auto n_y = static_cast<Eigen::Index>(shape[1]);
  const auto n_u = static_cast<Eigen::Index>(shape[2]);
  const std::vector<double> data = file.read_reals("/response_variance");
  Eigen::MatrixXd variance(n_y * n_u, frequency_hz.size());
  std::size_t at = 0;
  for (Eigen::Index k = 0; k < variance.cols(); ++k)
    for (Eigen::Index i = 0; i < n_y; ++i)
      for (Eigen::Index j = 0; j < n_u; ++j) variance(i + n_y * j, k) = data[at++];
  return variance;
}

}  // namespace stageid
