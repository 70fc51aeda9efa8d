// Layout: docs/formats.md. A file needs only the format attribute, frequency_hz, response, inputs and
// outputs. /confidence_radius follows from the other datasets and is not read.
#include "frf/file/frf_file.hpp"

#include <algorithm>
#include <complex>
#include <type_traits>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/output_file.hpp"
#include "frf/file/frf_file_quality.hpp"
#include "frf/file/line_datasets.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/response/confidence.hpp"

namespace stageid {
namespace {

constexpr const char* kFormat = "stageid-frf";
constexpr long long kFormatVersion = 1;
constexpr double kConfidenceLevel = 0.95;

// Writing -----------------------------------------------------------------------------------------

void write_channels(Hdf5File& file, const std::string& dataset, const ChannelList& channels) {
  file.write_texts(dataset, channels.names);
  const std::vector<std::string>& units = channels.units;
  if (std::ranges::all_of(units, [&](const std::string& u) { return u == units.front(); }))
    file.write_attribute(dataset, "unit", units.front());
  else
    file.write_attribute(dataset, "unit", units);
}

/// Calls use(name, value) for every attribute; a const estimate is written, without those that are usually 1.
template <typename Frf, typename Use>
void for_each_attribute(Frf& frf, const Use& use) {
  use("sample_rate_hz", frf.sample_rate_hz);
  use("hold", frf.hold);
  use("compensated", frf.compensated);
  use("delay_s", frf.delay_s);
  use("method", frf.method);
  use("covariance_lines", frf.covariance_lines);
  use("realizations", frf.realizations);
  use("periods", frf.periods);
  use("experiments", frf.experiments);
  use("noise_dof", frf.noise_dof);
  use("total_dof", frf.total_dof);
  for (const auto& [name, member] :
       {std::pair{"correlated_lines", &FrfEstimate::correlated_lines},
        {"experiment_noise_ratio", &FrfEstimate::experiment_noise_ratio}})
    if (!std::is_const_v<Frf> || frf.*member != 1.0) use(name, frf.*member);
}

struct AttributeWriter {
  Hdf5File& file;
  void operator()(const char* name, double value) const { file.write_attribute("/", name, value); }
  void operator()(const char* name, int value) const {
    file.write_attribute("/", name, static_cast<long long>(value));
  }
  template <HasWords Enum>
  void operator()(const char* name, Enum value) const {
    file.write_attribute("/", name, std::string(to_string(value)));
  }
};

/// From the total variance if it is known, because it predicts another measurement.
void write_confidence(Hdf5File& file, const FrfEstimate& frf) {
  const bool total = frf.total_variance.size() != 0 && frf.total_dof > 0.0;
  if (!total && (frf.noise_variance.size() == 0 || !(frf.noise_dof > 0.0))) return;
  const char* dataset = "/confidence_radius";
  const VarianceKind of = total ? VarianceKind::total : VarianceKind::noise;
  write_columns(file, dataset, confidence_radius(frf, kConfidenceLevel, of), frf.n_outputs());
  file.write_attribute(dataset, "level", kConfidenceLevel);
  file.write_attribute(dataset, "of", std::string(to_string(of)));
}

void write_optional(Hdf5File& file, const FrfEstimate& frf) {
  const Eigen::Index n_y = frf.n_outputs();
  write_columns(file, "/noise_variance", frf.noise_variance, n_y);
  write_columns(file, "/total_variance", frf.total_variance, n_y);
  write_confidence(file, frf);
  write_columns(file, "/covariance", frf.covariance, n_y * frf.n_inputs());
  write_columns(file, "/residual_covariance", frf.residual_covariance, n_y);
  write_columns(file, "/input_factor", frf.input_factor, frf.n_inputs());
  write_known(file, "/input_condition", frf.input_condition);
  write_known(file, "/interpolation_misfit", frf.interpolation_misfit);
  if (!frf.excluded_channels.empty()) {
    file.write_texts("/excluded_channels", frf.excluded_channels);
    write_known(file, "/excluded_power", frf.excluded_power);
  }
  write_quality(file, frf);
  file.write_texts("/provenance", {frf.provenance_json});
}

// Reading -----------------------------------------------------------------------------------------

/// Leaves values without an attribute as they are.
struct AttributeReader {
  const Hdf5File& file;
  void operator()(const char* name, double& value) const {
    if (file.has_attribute("/", name)) value = file.read_real_attribute("/", name);
  }
  void operator()(const char* name, int& value) const {
    if (!file.has_attribute("/", name)) return;
    const long long count = file.read_integer_attribute("/", name);
    if (count < 0 || count > 1'000'000'000)
      fail_format(file.path(), "/", "attribute {} is {}; expected a count", name, count);
    value = static_cast<int>(count);
  }
  template <HasWords Enum>
  void operator()(const char* name, Enum& value) const {
    if (!file.has_attribute("/", name)) return;
    const std::string word = file.read_text_attribute("/", name);
    const auto known = from_word<Enum>(word);
    if (!known)
      fail_format(file.path(), "/", "{} is '{}'; expected {}", name, word,
                  one_of(kWords<Enum>, "'"));
    value = *known;
  }
};

ChannelList read_channels(const Hdf5File& file, const std::string& dataset) {
  ChannelList channels;
  channels.names = file.read_texts(dataset);
  if (channels.names.empty())
    throw FormatError(file.path(), dataset, "no channels; name at least one");
  if (file.has_attribute(dataset, "unit"))
    channels.units = file.read_texts_attribute(dataset, "unit");
  if (channels.units.empty()) channels.units = {"1"};
  if (channels.units.size() == 1)
    channels.units.assign(channels.size(), std::string(channels.units[0]));
  return channels;
}

void read_optional(const Hdf5File& file, FrfEstimate& frf) {
  using Complex = std::complex<double>;
  const Eigen::Index N = frf.lines();
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  frf.covariance = read_columns<Complex>(file, "/covariance", N, n_y * n_u, n_y * n_u);
  frf.residual_covariance = read_columns<Complex>(file, "/residual_covariance", N, n_y, n_y);
  frf.input_factor = read_columns<Complex>(file, "/input_factor", N, n_u, n_u);
  frf.input_condition = read_known(file, "/input_condition", N);
  frf.interpolation_misfit = read_known(file, "/interpolation_misfit", N);
  if (file.exists("/excluded_channels")) {
    frf.excluded_channels = file.read_texts("/excluded_channels");
    require_shape(file, "/excluded_power", {frf.excluded_channels.size()});
    frf.excluded_power = read_vector(file, "/excluded_power");
  }
  read_quality(file, frf);
  if (file.exists("/provenance")) {
    const std::vector<std::string> text = file.read_texts("/provenance");
    if (text.size() == 1) frf.provenance_json = text.front();
  }
}

void check_as_read(const std::filesystem::path& path, const FrfEstimate& frf) {
  try {
    check(frf);
  } catch (const std::invalid_argument& error) {
    // check() reports "response[line 12, z1 <- a3]: not finite"; the position is appended to the file's name.
    const std::string text = error.what();
    const std::size_t colon = text.find(": ");
    throw FormatError(path, "/" + text.substr(0, colon), text.substr(colon + 2));
  }
}

}  // namespace

void write_frf(const std::filesystem::path& path, const FrfEstimate& frf) {
  check(frf);
  OutputFile output(path);
  Hdf5File file = Hdf5File::create(output.path(), path);
  file.write_attribute("/", "format", std::string(kFormat));
  file.write_attribute("/", "format_version", kFormatVersion);
  for_each_attribute(frf, AttributeWriter{file});
  write_known(file, "/frequency_hz", frf.frequency_hz);
  write_columns(file, "/response", frf.response, frf.n_outputs());
  write_channels(file, "/inputs", frf.inputs);
  write_channels(file, "/outputs", frf.outputs);
  write_optional(file, frf);
  file.close();
  output.commit();
}

FrfEstimate read_frf(const std::filesystem::path& path, const Team* team) {
  const Hdf5File file = Hdf5File::open(path);
  require_format(file, kFormat, "a frequency response",
                 ". Convert files of other programs with 'stageid import'");
  if (file.has_attribute("/", "format_version")) require_version(file, kFormatVersion);
  FrfEstimate frf;
  for_each_attribute(frf, AttributeReader{file});
  frf.covariance_lines = std::max(1, frf.covariance_lines);
  frf.inputs = read_channels(file, "/inputs");
  frf.outputs = read_channels(file, "/outputs");
  const std::vector<hsize_t> lines = file.shape("/frequency_hz");
  if (lines.size() != 1 || lines[0] == 0)
    fail_format(path, "/frequency_hz", "shape is {}; expected one number per line",
                join_shape(lines));
  frf.frequency_hz = read_vector(file, "/frequency_hz");
  require_shape(file, "/response", {lines[0], size_of(frf.n_outputs()), size_of(frf.n_inputs())});
  read_optional(file, frf);
  const Eigen::Index N = frf.lines();
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  const bool connected = frf.residual_covariance.size() > 0 || frf.covariance.size() > 0;
  if (team != nullptr && !connected) frf.team = team;
  const DataRange own = own_channels(*frf.team, n_y * n_u);
  frf.response = read_part<std::complex<double>>(file, "/response", N, n_y, n_u, own);
  frf.noise_variance = read_part<double>(file, "/noise_variance", N, n_y, n_u, own);
  frf.total_variance = read_part<double>(file, "/total_variance", N, n_y, n_u, own);
  check_as_read(path, frf);
  return frf;
}

}  // namespace stageid
