// Layout: docs/formats.md. A file needs only the format attribute, frequency_hz, response, inputs and
// outputs. /confidence_radius follows from the other datasets and is not read.
#include "frf/file/frf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <complex>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/output_file.hpp"
#include "frf/file/frf_file_quality.hpp"
#include "frf/file/line_datasets.hpp"
#include "frf/response/confidence.hpp"

namespace stageid {
namespace {

constexpr const char* kFormat = "stageid-frf";
constexpr long long kFormatVersion = 1;
constexpr double kConfidenceLevel = 0.95;

// Writing -----------------------------------------------------------------------------------------

void write_channels(Hdf5File& file, const std::string& dataset, const ChannelList& channels) {
  file.write_texts(dataset, channels.names);
  const bool one_unit =
      std::all_of(channels.units.begin(), channels.units.end(),
                  [&](const std::string& u) { return u == channels.units.front(); });
  if (one_unit) {
    file.write_attribute(dataset, "unit", channels.units.front());
  } else {
    file.write_attribute(dataset, "unit", channels.units);
  }
}

void write_attributes(Hdf5File& file, const FrfEstimate& frf) {
  file.write_attribute("/", "format", std::string(kFormat));
  file.write_attribute("/", "format_version", kFormatVersion);
  file.write_attribute("/", "sample_rate_hz", frf.sample_rate_hz);
  file.write_attribute("/", "hold", std::string(to_string(frf.hold)));
  file.write_attribute("/", "compensated", std::string(to_string(frf.compensated)));
  file.write_attribute("/", "delay_s", frf.delay_s);
  file.write_attribute("/", "method", std::string(to_string(frf.method)));
  file.write_attribute("/", "covariance_lines", static_cast<long long>(frf.covariance_lines));
  file.write_attribute("/", "realizations", static_cast<long long>(frf.realizations));
  file.write_attribute("/", "periods", static_cast<long long>(frf.periods));
  file.write_attribute("/", "experiments", static_cast<long long>(frf.experiments));
  file.write_attribute("/", "noise_dof", frf.noise_dof);
  file.write_attribute("/", "total_dof", frf.total_dof);
  if (frf.correlated_lines != 1.0)
    file.write_attribute("/", "correlated_lines", frf.correlated_lines);
  if (frf.experiment_noise_ratio != 1.0)
    file.write_attribute("/", "experiment_noise_ratio", frf.experiment_noise_ratio);
}

/// From the total variance if it is known, because it predicts another measurement.
template <typename WriteVariance>
void write_confidence(Hdf5File& file, const FrfEstimate& frf, const WriteVariance& write) {
  const bool total = frf.total_variance.size() != 0 && frf.total_dof > 0.0;
  if (!total && (frf.noise_variance.size() == 0 || !(frf.noise_dof > 0.0))) return;
  const char* dataset = "/confidence_radius";
  const VarianceKind of = total ? VarianceKind::total : VarianceKind::noise;
  write(dataset, confidence_radius(frf, kConfidenceLevel, of));
  file.write_attribute(dataset, "level", kConfidenceLevel);
  file.write_attribute(dataset, "of", std::string(to_string(of)));
}

void write_optional(Hdf5File& file, const FrfEstimate& frf) {
  const hsize_t N = size_of(frf.lines());
  const hsize_t n_y = size_of(frf.n_outputs());
  const hsize_t n_u = size_of(frf.n_inputs());
  const auto write_variance = [&](const std::string& dataset, const Eigen::MatrixXd& variance) {
    if (variance.size() == 0) return;
    file.write_reals(dataset, {N, n_y, n_u}, to_c_order<double>(variance, frf.n_outputs()).data());
  };
  write_variance("/noise_variance", frf.noise_variance);
  write_variance("/total_variance", frf.total_variance);
  write_confidence(file, frf, write_variance);
  if (frf.covariance.size() != 0) {
    const Eigen::Index n_c = frf.n_outputs() * frf.n_inputs();
    file.write_complex("/covariance", {N, n_y * n_u, n_y * n_u},
                       to_c_order<std::complex<double>>(frf.covariance, n_c).data());
  }
  if (frf.residual_covariance_re.size() != 0) {
    Eigen::MatrixXcd residual(frf.residual_covariance_re.rows(), frf.lines());
    residual.real() = frf.residual_covariance_re;
    residual.imag() = frf.residual_covariance_im;
    file.write_complex("/residual_covariance", {N, n_y, n_y},
                       to_c_order<std::complex<double>>(residual, frf.n_outputs()).data());
  }
  if (frf.input_factor.size() != 0) {
    file.write_complex("/input_factor", {N, n_u, n_u},
                       to_c_order<std::complex<double>>(frf.input_factor, frf.n_inputs()).data());
  }
  if (frf.input_condition.size() != 0) {
    file.write_reals("/input_condition", {N}, frf.input_condition.data());
  }
  if (frf.interpolation_misfit.size() != 0) {
    file.write_reals("/interpolation_misfit", {N}, frf.interpolation_misfit.data());
  }
  if (!frf.excluded_channels.empty()) {
    file.write_texts("/excluded_channels", frf.excluded_channels);
    file.write_reals("/excluded_power", {size_of(frf.excluded_power.size())},
                     frf.excluded_power.data());
  }
  write_quality(file, frf);
  file.write_texts("/provenance", {frf.provenance_json});
}

// Reading -----------------------------------------------------------------------------------------

double real_or(const Hdf5File& file, const std::string& name, double otherwise) {
  return file.has_attribute("/", name) ? file.read_real_attribute("/", name) : otherwise;
}

int integer_or_zero(const Hdf5File& file, const std::string& name) {
  if (!file.has_attribute("/", name)) return 0;
  const long long value = file.read_integer_attribute("/", name);
  if (value < 0 || value > 1'000'000'000) {
    throw FormatError(file.path(), "/",
                      fmt::format("attribute {} is {}; expected a count", name, value));
  }
  return static_cast<int>(value);
}

void require_format(const Hdf5File& file) {
  if (!file.has_attribute("/", "format")) {
    throw FormatError(file.path(), "/",
                      fmt::format("attribute format is missing; expected '{}'", kFormat));
  }
  const std::string format = file.read_text_attribute("/", "format");
  if (format != kFormat) {
    const std::string other = other_hdf5_kind(format, "a frequency response");
    throw FormatError(file.path(), "/",
                      !other.empty()
                          ? other
                          : fmt::format("format is '{}'; expected '{}'. Convert files of other "
                                        "programs with 'stageid import'",
                                        format, kFormat));
  }
  if (!file.has_attribute("/", "format_version")) return;
  const long long version = file.read_integer_attribute("/", "format_version");
  if (version != kFormatVersion) {
    throw FormatError(file.path(), "/",
                      fmt::format("unsupported format_version {}; this program reads {}", version,
                                  kFormatVersion));
  }
}

/// The first word of the table if the attribute is missing.
template <typename Enum>
Enum read_word(const Hdf5File& file, const std::string& attribute) {
  if (!file.has_attribute("/", attribute)) return Enum{};
  const std::string word = file.read_text_attribute("/", attribute);
  if (const auto value = from_word<Enum>(word)) return *value;
  throw FormatError(
      file.path(), "/",
      fmt::format("{} is '{}'; expected {}", attribute, word, one_of(kWords<Enum>, "'")));
}

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
  const hsize_t N = size_of(frf.lines());
  const hsize_t n_y = size_of(frf.n_outputs());
  const hsize_t n_u = size_of(frf.n_inputs());
  const auto read_variance = [&](const std::string& dataset) -> Eigen::MatrixXd {
    if (!file.exists(dataset)) return {};
    require_shape(file, dataset, {N, n_y, n_u});
    return from_c_order(file.read_reals(dataset), frf.n_outputs(), frf.n_inputs());
  };
  frf.noise_variance = read_variance("/noise_variance");
  frf.total_variance = read_variance("/total_variance");
  if (file.exists("/covariance")) {
    require_shape(file, "/covariance", {N, n_y * n_u, n_y * n_u});
    const Eigen::Index n_c = frf.n_outputs() * frf.n_inputs();
    frf.covariance = from_c_order(file.read_complex("/covariance"), n_c, n_c);
  }
  if (file.exists("/residual_covariance")) {
    require_shape(file, "/residual_covariance", {N, n_y, n_y});
    const Eigen::MatrixXcd residual =
        from_c_order(file.read_complex("/residual_covariance"), frf.n_outputs(), frf.n_outputs());
    frf.residual_covariance_re = residual.real();
    frf.residual_covariance_im = residual.imag();
  }
  if (file.exists("/input_factor")) {
    require_shape(file, "/input_factor", {N, n_u, n_u});
    frf.input_factor =
        from_c_order(file.read_complex("/input_factor"), frf.n_inputs(), frf.n_inputs());
  }
  const auto read_vector = [&](const std::string& dataset, hsize_t size) -> Eigen::VectorXd {
    require_shape(file, dataset, {size});
    const std::vector<double> values = file.read_reals(dataset);
    return Eigen::Map<const Eigen::VectorXd>(values.data(),
                                             static_cast<Eigen::Index>(values.size()));
  };
  if (file.exists("/input_condition")) frf.input_condition = read_vector("/input_condition", N);
  if (file.exists("/interpolation_misfit"))
    frf.interpolation_misfit = read_vector("/interpolation_misfit", N);
  if (file.exists("/excluded_channels")) {
    frf.excluded_channels = file.read_texts("/excluded_channels");
    frf.excluded_power = read_vector("/excluded_power", frf.excluded_channels.size());
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
  write_attributes(file, frf);
  file.write_reals("/frequency_hz", {size_of(frf.lines())}, frf.frequency_hz.data());
  file.write_complex("/response",
                     {size_of(frf.lines()), size_of(frf.n_outputs()), size_of(frf.n_inputs())},
                     to_c_order<std::complex<double>>(frf.response, frf.n_outputs()).data());
  write_channels(file, "/inputs", frf.inputs);
  write_channels(file, "/outputs", frf.outputs);
  write_optional(file, frf);
  file.close();
  output.commit();
}

FrfEstimate read_frf(const std::filesystem::path& path) {
  const Hdf5File file = Hdf5File::open(path);
  require_format(file);
  FrfEstimate frf;
  frf.sample_rate_hz = real_or(file, "sample_rate_hz", 0.0);
  frf.hold = read_word<Hold>(file, "hold");
  frf.compensated = read_word<Compensation>(file, "compensated");
  frf.delay_s = real_or(file, "delay_s", 0.0);
  frf.method = read_word<FrfMethod>(file, "method");
  frf.covariance_lines = std::max(1, integer_or_zero(file, "covariance_lines"));
  frf.realizations = integer_or_zero(file, "realizations");
  frf.periods = integer_or_zero(file, "periods");
  frf.experiments = integer_or_zero(file, "experiments");
  frf.noise_dof = real_or(file, "noise_dof", 0.0);
  frf.total_dof = real_or(file, "total_dof", 0.0);
  frf.correlated_lines = real_or(file, "correlated_lines", 1.0);
  frf.experiment_noise_ratio = real_or(file, "experiment_noise_ratio", 1.0);

  frf.inputs = read_channels(file, "/inputs");
  frf.outputs = read_channels(file, "/outputs");
  const std::vector<hsize_t> lines = file.shape("/frequency_hz");
  if (lines.size() != 1 || lines[0] == 0) {
    throw FormatError(path, "/frequency_hz",
                      fmt::format("shape is {}; expected one number per line", join_shape(lines)));
  }
  const std::vector<double> frequency = file.read_reals("/frequency_hz");
  frf.frequency_hz = Eigen::Map<const Eigen::VectorXd>(frequency.data(),
                                                       static_cast<Eigen::Index>(frequency.size()));
  require_shape(file, "/response", {lines[0], size_of(frf.n_outputs()), size_of(frf.n_inputs())});
  frf.response = from_c_order(file.read_complex("/response"), frf.n_outputs(), frf.n_inputs());
  read_optional(file, frf);
  check_as_read(path, frf);
  return frf;
}

}  // namespace stageid
