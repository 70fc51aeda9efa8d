#include "tools/exchange/model/model_export.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/output_file.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/exchange/arrays/frf_csv.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/exchange/model/model_csv.hpp"
#include "tools/exchange/model/model_script.hpp"
#include "tools/exchange/uff/uff_frf.hpp"
#include "tools/exchange/uff/uff_modes.hpp"

namespace stageid {
namespace {

const std::vector<std::string> kModelEndings = {".json", ".h5",  ".hdf5", ".csv", ".mat",
                                                ".npz",  ".unv", ".uff",  ".py",  ".m"};
const std::vector<std::string> kFrfEndings = {".mat", ".npz", ".csv", ".unv", ".uff"};

void require_ending(const std::filesystem::path& file, const std::vector<std::string>& endings,
                    const char* what) {
  const std::string ending = file.extension().string();
  if (std::find(endings.begin(), endings.end(), ending) != endings.end()) return;
  throw std::invalid_argument(fmt::format("{}: {} cannot be exported as '{}'; use one of {}",
                                          file.string(), what, ending, fmt::join(endings, ", ")));
}

void write_arrays(const std::filesystem::path& file, ArrayList list, MatVersion mat_version) {
  list.file = file;
  if (file.extension() == ".mat")
    write_mat(file, list, mat_version);
  else
    write_npz(file, list);
}

UffEncoding encoding_of(const std::filesystem::path& file) {
  return file.extension() == ".uff" ? UffEncoding::binary : UffEncoding::text;
}

/// The content of the .h5 file of the model, read from a temporary file beside the target.
ArrayList arrays_of_model(const std::filesystem::path& beside, const AdditiveModel& model,
                          const ExportedResponse& response,
                          const std::optional<DrivingPoint>& driving_point) {
  const OutputFile scratch(beside);
  write_model_hdf5(scratch.path(), model, response, driving_point);
  return read_hdf5_arrays(scratch.path());
}

UffContent uff_of_model(const std::filesystem::path& file, const AdditiveModel& model,
                        const Eigen::VectorXd& frequency_hz) {
  if (frequency_hz.size() == 0)
    throw std::invalid_argument(fmt::format(
        "{}: the model does not contain its band; define the lines of the response with --frf FRF",
        file.string()));
  FrfEstimate frf;
  frf.frequency_hz = frequency_hz;
  frf.inputs = model.inputs;
  frf.outputs = model.outputs;
  frf.sample_rate_hz = model.sample_rate_hz;
  frf.hold = model.hold == HoldModel::none ? Hold::none : Hold::zoh;
  frf.response = stageid::response(model, frequency_hz, model.hold);
  UffContent content = uff_of_frf(frf);
  content.model_name = "stageid model";
  content.modes = uff_modes(model);
  return content;
}

}  // namespace

void require_export_format(const std::filesystem::path& file) {
  require_ending(file, kModelEndings, "models");
}

void require_frf_export_format(const std::filesystem::path& file) {
  require_ending(file, kFrfEndings, "frequency responses");
}

void export_model(const std::filesystem::path& file, const AdditiveModel& model,
                  const ExportedResponse& response,
                  const std::optional<DrivingPoint>& driving_point, MatVersion mat_version) {
  require_export_format(file);
  const std::string ending = file.extension().string();
  if (ending == ".json")
    write_model(file, model);
  else if (ending == ".csv")
    write_text_file(file, model_csv(model));
  else if (ending == ".py" || ending == ".m")
    write_text_file(
        file, model_script(model, ending == ".m" ? ScriptLanguage::matlab : ScriptLanguage::python,
                           file.stem().string()));
  else if (ending == ".unv" || ending == ".uff")
    write_uff(file, uff_of_model(file, model, response.frequency_hz), encoding_of(file));
  else if (ending == ".mat" || ending == ".npz")
    write_arrays(file, arrays_of_model(file, model, response, driving_point), mat_version);
  else
    write_model_hdf5(file, model, response, driving_point);
}

void export_frf(const std::filesystem::path& file, const FrfEstimate& frf, MatVersion mat_version) {
  require_frf_export_format(file);
  if (file.extension() == ".unv" || file.extension() == ".uff")
    write_uff(file, uff_of_frf(frf), encoding_of(file));
  else if (file.extension() == ".csv")
    write_text_file(file, frf_csv(frf));
  else
    write_arrays(file, arrays_of_frf(frf, file), mat_version);
}

}  // namespace stageid
