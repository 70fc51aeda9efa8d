#include "tools/watch/track_file.hpp"

#include <cmath>
#include <complex>
#include <limits>
#include <optional>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_matrices.hpp"
#include "frf/file/line_datasets.hpp"

namespace stageid {
namespace {

constexpr hsize_t kChunkRows = 64;
constexpr const char* kFormat = "stageid-watch";

}  // namespace

TrackFile::TrackFile(const std::filesystem::path& file, const ModelTracker& tracker,
                     const AdditiveModel& model, const std::filesystem::path& model_file,
                     const WatchSource& source)
    : outputs_(model.n_outputs()), output_(file), hdf5_(Hdf5File::create(output_.path(), file)) {
  const auto columns = static_cast<hsize_t>(tracker.parameters().size());
  hdf5_.write_attribute("/", "format", std::string(kFormat));
  hdf5_.write_attribute("/", "format_version", 1LL);
  hdf5_.write_attribute("/", "model", model_file.string());
  hdf5_.write_attribute("/", "started_utc", source.started_utc());
  write_vector(hdf5_, "/frequency_hz", source.frequency_hz());
  std::vector<std::string> names;
  std::vector<std::string> kinds;
  std::vector<double> nominal;
  for (const TrackedParameter& parameter : tracker.parameters()) {
    names.push_back(describe(parameter, model));
    kinds.emplace_back(to_string(parameter.kind));
    nominal.push_back(nominal_value(parameter, model));
  }
  hdf5_.write_texts("/names", names);
  hdf5_.write_texts("/kinds", kinds);
  write_vector(hdf5_, "/nominal", nominal);
  hdf5_.write_texts("/sensors", model.outputs.names);
  hdf5_.write_texts("/actuators", model.inputs.names);
  for (const char* scalar : {"/time_s", "/learning", "/statistic", "/threshold"})
    hdf5_.create_growing(scalar, 0, H5T_IEEE_F64LE, kChunkRows);
  for (const char* row : {"/change", "/deviation"})
    hdf5_.create_growing(row, columns, H5T_IEEE_F64LE, kChunkRows);
  const auto sensors = static_cast<hsize_t>(outputs_);
  hdf5_.create_growing("/noise_power", sensors, H5T_IEEE_F64LE, kChunkRows);
  hdf5_.create_growing("/statistics", columns + sensors, H5T_IEEE_F64LE, kChunkRows);
}

void TrackFile::add(const WatchedPeriod& period, const TrackedPeriod& state,
                    const ModelTracker& tracker) {
  const double learning = state.learning ? 1.0 : 0.0;
  hdf5_.append_rows("/time_s", 1, &period.time_s);
  hdf5_.append_rows("/learning", 1, &learning);
  hdf5_.append_rows("/statistic", 1, &state.largest_statistic);
  hdf5_.append_rows("/threshold", 1, &state.threshold);
  const Eigen::VectorXd deviation = tracker.covariance().diagonal().cwiseSqrt();
  hdf5_.append_rows("/change", 1, tracker.estimate().data());
  hdf5_.append_rows("/deviation", 1, deviation.data());
  const auto append = [&](const char* dataset, const Eigen::VectorXd& known, Eigen::Index size) {
    const Eigen::VectorXd unknown =
        Eigen::VectorXd::Constant(size, std::numeric_limits<double>::quiet_NaN());
    hdf5_.append_rows(dataset, 1, known.size() > 0 ? known.data() : unknown.data());
  };
  append("/noise_power", state.noise_power, outputs_);
  append("/statistics", state.statistics, deviation.size() + outputs_);
}

void TrackFile::commit(const ModelTracker& tracker) {
  write_matrix(hdf5_, "/covariance", tracker.covariance());
  write_columns<std::complex<double>>(hdf5_, "/response", tracker.response(), outputs_);
  write_columns<double>(hdf5_, "/response_variance", tracker.response_variance(), outputs_);
  hdf5_.close();
  output_.commit();
}

WatchedTracks read_tracks(const std::filesystem::path& file, double every_s) {
  const Hdf5File hdf5 = Hdf5File::open(file);
  if (!hdf5.has_attribute("/", "format") || hdf5.read_text_attribute("/", "format") != kFormat)
    throw FormatError(file, "",
                      "contains no tracks; give a file that 'stageid watch -o' has written");
  WatchedTracks out{hdf5.read_text_attribute("/", "started_utc"),
                    hdf5.read_texts("/names"),
                    {},
                    hdf5.read_reals("/nominal"),
                    {},
                    {},
                    {}};
  for (const std::string& word : hdf5.read_texts("/kinds")) {
    const std::optional<TrackedKind> kind = from_word<TrackedKind>(word);
    if (!kind) throw FormatError(file, "/kinds", "contains the unknown kind '" + word + "'");
    out.kinds.push_back(*kind);
  }
  const std::vector<double> time_s = hdf5.read_reals("/time_s");
  const std::vector<double> learning = hdf5.read_reals("/learning");
  const std::size_t q = out.names.size();
  const std::vector<hsize_t> rows = {time_s.size(), q};
  if (q == 0 || out.kinds.size() != q || out.nominal.size() != q ||
      learning.size() != time_s.size() || hdf5.shape("/change") != rows ||
      hdf5.shape("/deviation") != rows)
    throw FormatError(file, "", "its datasets do not fit each other; watch the log again");
  std::vector<hsize_t> chosen;
  for (std::size_t t = 0; t < time_s.size(); ++t) {
    if (!std::isfinite(time_s[t]))
      throw FormatError(file, "/time_s", "contains a value that is not finite");
    if (learning[t] != 0.0) continue;
    const auto part = [&](std::size_t row) { return std::floor(time_s[row] / every_s); };
    if (!chosen.empty() && part(chosen.back()) == part(t))
      chosen.back() = t;
    else
      chosen.push_back(t);
  }
  const auto read = [&](const char* dataset) {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values(
        std::ssize(chosen), static_cast<Eigen::Index>(q));
    for (std::size_t r = 0; r < chosen.size(); ++r)
      hdf5.read_rows(dataset, chosen[r], 1, values.row(r).data());
    return values;
  };
  out.change = read("/change");
  out.deviation = read("/deviation");
  for (const hsize_t row : chosen) out.time_s.push_back(time_s[row]);
  return out;
}

}  // namespace stageid
