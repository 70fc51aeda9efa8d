#include "tools/exchange/model/model_hdf5.hpp"

#include <fmt/format.h>

#include <complex>

#include "acquisition/files/hdf5_matrices.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/output_file.hpp"
#include "frf/file/line_datasets.hpp"
#include "tools/exchange/model/modal_hdf5.hpp"

namespace stageid {
namespace {

void write_submodels(Hdf5File& file, const AdditiveModel& model) {
  file.create_group("/submodels");
  for (std::size_t index = 0; index < model.submodels.size(); ++index) {
    const Submodel& s = model.submodels[index];
    const std::string group = fmt::format("/submodels/{:04}", index);
    file.create_group(group);
    file.write_attribute(group, "integrators", static_cast<long long>(s.integrators));
    write_vector(file, group + "/denominator", s.denominator);
    std::vector<double> numerator;
    for (const Eigen::MatrixXd& B : s.numerator)
      for (Eigen::Index i = 0; i < B.rows(); ++i)
        for (Eigen::Index j = 0; j < B.cols(); ++j) numerator.push_back(B(i, j));
    file.write_reals(group + "/numerator",
                     {s.numerator.size(), size_of(model.n_outputs()), size_of(model.n_inputs())},
                     numerator.data());
  }
}

std::string model_text(const AdditiveModel& model, const std::filesystem::path& beside) {
  // write_model() only writes files, so its text is read from a temporary file beside the target.
  const OutputFile scratch(beside.string() + ".json");
  write_model(scratch.path(), model);
  return read_whole_file(scratch.path());
}

/// Content needed by every reader: channels, delays, and the model in the format of stageid.
void write_head(Hdf5File& file, const std::filesystem::path& target, const AdditiveModel& model) {
  file.write_attribute("/", "format", std::string("stageid-model"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "sample_rate_hz", model.sample_rate_hz);
  file.write_attribute("/", "hold", std::string(to_string(model.hold)));
  file.write_texts("/inputs", model.inputs.names);
  file.write_attribute("/inputs", "unit", model.inputs.units);
  file.write_texts("/outputs", model.outputs.names);
  file.write_attribute("/outputs", "unit", model.outputs.units);
  write_vector(file, "/input_delay_s", model.input_delays_s());
  write_vector(file, "/output_delay_s", model.output_delays_s());
  file.write_texts("/model_json", {model_text(model, target)});
}

void write_response(Hdf5File& file, const AdditiveModel& model, const ExportedResponse& exported) {
  if (exported.frequency_hz.size() == 0) return;
  const hsize_t N = size_of(exported.frequency_hz.size());
  const std::vector<hsize_t> shape = {N, size_of(model.n_outputs()), size_of(model.n_inputs())};
  write_vector(file, "/frequency_hz", exported.frequency_hz);
  const Eigen::MatrixXcd P = response(model, exported.frequency_hz, model.hold);
  file.write_complex("/response", shape,
                     to_c_order<std::complex<double>>(P, model.n_outputs()).data());
  if (exported.variance.size() > 0)
    file.write_reals("/response_variance", shape,
                     to_c_order<double>(exported.variance, model.n_outputs()).data());
}

}  // namespace

void write_model_hdf5(const std::filesystem::path& target, const AdditiveModel& model,
                      const ExportedResponse& exported,
                      const std::optional<DrivingPoint>& driving_point) {
  OutputFile output(target);
  Hdf5File file = Hdf5File::create(output.path(), target);
  write_head(file, target, model);
  write_submodels(file, model);
  write_modal_form(file, model, driving_point);
  write_state_spaces(file, model);
  write_response(file, model, exported);
  file.close();
  output.commit();
}

Eigen::MatrixXd read_response_variance(const std::filesystem::path& path,
                                       const Eigen::VectorXd& frequency_hz) {
  const Hdf5File file = Hdf5File::open(path);
  if (!file.exists("/response_variance") || !file.exists("/frequency_hz")) return {};
  const std::vector<double> lines = file.read_reals("/frequency_hz");
  if (!std::equal(lines.begin(), lines.end(), frequency_hz.begin(), frequency_hz.end())) return {};
  const std::vector<hsize_t> shape = file.shape("/response_variance");
  if (shape.size() != 3 || shape[0] != lines.size()) return {};
  return from_c_order(file.read_reals("/response_variance"), static_cast<Eigen::Index>(shape[1]),
                      static_cast<Eigen::Index>(shape[2]));
}

}  // namespace stageid
