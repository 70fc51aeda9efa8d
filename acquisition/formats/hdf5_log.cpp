#include "acquisition/formats/hdf5_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/record/log_checks.hpp"
#include "acquisition/record/row_transpose.hpp"
#include "acquisition/slog/slog_format.hpp"

namespace stageid {

namespace {

constexpr std::size_t kPieceBytes = std::size_t{4} << 20;

/// An integer attribute of the file that must fit an int.
int read_int(const Hdf5File& file, const std::string& object, const std::string& name) {
  const long long value = file.read_integer_attribute(object, name);
  if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
    fail_format(file.path(), object, "attribute {} is out of range: {}", name, value);
  return static_cast<int>(value);
}

ChannelList read_channel_list(const Hdf5File& file, const std::string& dataset) {
  ChannelList channels;
  channels.names = file.read_texts(dataset);
  if (file.has_attribute(dataset, "unit")) {
    channels.units = file.read_texts_attribute(dataset, "unit");
  } else {
    channels.units = {""};
  }
  if (channels.units.size() == 1) channels.units.assign(channels.size(), channels.units.front());
  if (channels.units.size() != channels.size())
    fail_format(file.path(), dataset, "has {} and {}; give one unit, or one per channel",
                counted(channels.size(), "channel"), counted(channels.units.size(), "unit"));
  return channels;
}

/// A real attribute of one number or of `size` numbers.
std::vector<double> read_column_values(const Hdf5File& file, const std::string& dataset,
                                       const std::string& name, std::size_t size) {
  std::vector<double> values = file.read_reals_attribute(dataset, name);
  if (values.size() != 1 && values.size() != size)
    fail_format(file.path(), dataset, "attribute {} has {}; expected 1 or {}", name,
                counted(values.size(), "value"), size);
  if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }))
    fail_format(file.path(), dataset, "attribute {} is not finite", name);
  if (values.size() == 1) values.assign(size, values.front());
  return values;
}

}  // namespace

std::mutex& hdf5_mutex() noexcept {
  static std::mutex mutex;
  return mutex;
}

Hdf5LogReader::Hdf5LogReader(const std::filesystem::path& file) : path_(file) {
  const std::lock_guard lock(hdf5_mutex());
  file_ = Hdf5File::open(file);
  require_format(*file_, "stageid-log", "a log");
  require_version(*file_, 1);
  read_channels();
  if (!file_->exists("/runs"))
    throw FormatError(path_, "/runs", "is missing; expected groups /runs/0000, /runs/0001, ...");
  for (const std::string& name : file_->children("/runs")) read_run(name);
  check_runs(path_, info_, runs_);
}

Hdf5LogReader::~Hdf5LogReader() {
  const std::lock_guard lock(hdf5_mutex());
  file_.reset();
}

void Hdf5LogReader::read_channels() {
  info_.sample_rate_hz = file_->read_real_attribute("/", "sample_rate_hz");
  info_.period_samples = read_int(*file_, "/", "period_samples");
  info_.transient_periods = read_int(*file_, "/", "transient_periods");
  if (file_->has_attribute("/", "metadata_json"))
    info_.metadata_json = file_->read_text_attribute("/", "metadata_json");
  info_.excitation = read_channel_list(*file_, "/channels/excitation");
  info_.actuators = read_channel_list(*file_, "/channels/actuators");
  info_.sensors = read_channel_list(*file_, "/channels/sensors");
  try {
    check_log_info(info_);
  } catch (const std::invalid_argument& error) {
    std::string what = error.what();
    if (what.starts_with("log: ")) what.erase(0, 5);  // the file is the place
    throw FormatError(path_, "/", what);
  }
}

void Hdf5LogReader::read_run(const std::string& name) {
  const std::string group = "/runs/" + name;
  LogRun run;
  run.name = name;
  run.realization = read_int(*file_, group, "realization");
  run.experiment = read_int(*file_, group, "experiment");
  if (file_->has_attribute(group, "complete"))
    run.complete = file_->read_integer_attribute(group, "complete") != 0;
  if (file_->has_attribute(group, "started_utc"))
    run.started_utc = file_->read_text_attribute(group, "started_utc");
  Run place;
  place.excitation = open_dataset(group + "/excitation", info_.excitation.size());
  place.actuators = open_dataset(group + "/actuators", info_.actuators.size());
  place.sensors = open_dataset(group + "/sensors", info_.sensors.size());
  run.samples = place.sensors.rows;
  if (place.actuators.rows != run.samples)
    fail_format(path_, group, "actuators have {} rows, sensors {}; both must have the same number",
                place.actuators.rows, run.samples);
  check_excitation_length(run, place.excitation);
  if (file_->exists(group + "/marked")) {
    place.marked = group + "/marked";
    const std::vector<hsize_t> shape = file_->shape(place.marked);
    if (shape.size() != 1 || shape[0] != run.samples)
      fail_format(path_, place.marked, "must be a vector of {} numbers, one per sample",
                  run.samples);
  }
  run.health.cycles = run.samples;
  runs_.push_back(std::move(run));
  places_.push_back(std::move(place));
}

Hdf5LogReader::Dataset Hdf5LogReader::open_dataset(const std::string& name,
                                                   std::size_t columns) const {
  const std::vector<hsize_t> shape = file_->shape(name);
  if (shape.size() != 2 || shape[1] != columns)
    fail_format(path_, name, "has shape [{}]; expected two dimensions, samples x {} channels",
                fmt::join(shape, " x "), columns);
  return {name, read_scaling(name, columns), shape[0]};
}

Hdf5LogReader::Scaling Hdf5LogReader::read_scaling(const std::string& dataset,
                                                   std::size_t columns) const {
  const bool has_scale = file_->has_attribute(dataset, "scale");
  const bool has_offset = file_->has_attribute(dataset, "offset");
  if (!has_scale && !has_offset) return {};
  return {has_scale ? read_column_values(*file_, dataset, "scale", columns)
                    : std::vector<double>(columns, 1.0),
          has_offset ? read_column_values(*file_, dataset, "offset", columns)
                     : std::vector<double>(columns, 0.0)};
}

void Hdf5LogReader::check_excitation_length(const LogRun& run, const Dataset& excitation) const {
  const auto period = static_cast<std::uint64_t>(info_.period_samples);
  if (excitation.rows == period || (excitation.rows == run.samples && excitation.rows > period))
    return;
  fail_format(path_, excitation.name,
              "has {}; expected one period ({}) or the length of the run ({})",
              counted(excitation.rows, "row"), period, run.samples);
}

void Hdf5LogReader::read_columns(const Dataset& dataset, std::uint64_t first,
                                 Eigen::MatrixXd& out) const {
  const auto columns = static_cast<std::size_t>(out.cols());
  const auto rows = static_cast<std::uint64_t>(out.rows());
  if (columns == 0) return;
  const std::uint64_t piece_rows =
      std::max<std::uint64_t>(1, kPieceBytes / (columns * sizeof(double)));
  std::vector<double> piece(std::min(piece_rows, rows) * columns);
  for (std::uint64_t done = 0; done < rows; done += piece_rows) {
    const std::uint64_t count = std::min(piece_rows, rows - done);
    {
      const std::lock_guard lock(hdf5_mutex());
      file_->read_rows(dataset.name, first + done, count, piece.data());
    }
    // The caller searches for non-finite values, because only it can name them.
    static_cast<void>(transpose_rows(piece.data(), columns, static_cast<std::size_t>(count),
                                     columns, out.data() + done, static_cast<std::size_t>(rows)));
  }
  for (std::size_t c = 0; c < dataset.scaling.scale.size(); ++c) {
    auto column = out.col(c).array();
    column = dataset.scaling.scale[c] * column + dataset.scaling.offset[c];
  }
}

namespace {

constexpr Eigen::Index kFewestRows = 8;  // needed to locate the continuation of a record
constexpr Eigen::Index kPadding = 4;     // rows at its end, if the gap is in the last period

/// Row n of a periodic signal displaced by `ahead` rows.
auto row_of(const Eigen::MatrixXd& period, Eigen::Index n, Eigen::Index ahead) {
  return period.row((n + ahead) % period.rows());
}

/// First of the leading `rows` rows, from `from` on, that differs from the displaced period; `rows` if none does.
Eigen::Index first_other(const Eigen::MatrixXd& samples, const Eigen::MatrixXd& period,
                         Eigen::Index ahead, double tolerance, Eigen::Index from,
                         Eigen::Index rows) {
  const auto differs = [&](Eigen::Index n) {
    return !((samples.row(n) - row_of(period, n, ahead)).array().abs() <= tolerance).all();
  };
  while (from < rows && !differs(from)) ++from;
  return from;
}

/// If a recorder loses rows of all its signals, the record continues further ahead in the period.
/// @returns the displacement, if all rows from `gap` to `rows` fit one displaced period; otherwise `ahead`
Eigen::Index ahead_after_gap(const Eigen::MatrixXd& samples, const Eigen::MatrixXd& period,
                             Eigen::Index ahead, double tolerance, Eigen::Index gap,
                             Eigen::Index rows) {
  const Eigen::Index N = period.rows();
  if (gap + kFewestRows > rows) return ahead;
  for (Eigen::Index lost = 1; lost < N; ++lost)
    if (first_other(samples, period, ahead + lost, tolerance, gap, rows) == rows)
      return (ahead + lost) % N;
  return ahead;
}

}  // namespace

Eigen::MatrixXd Hdf5LogReader::excitation(std::size_t run) const {
  check_run_index(path_, runs_, run);
  const LogRun& which = runs_[run];
  const Dataset& dataset = places_[run].excitation;
  Eigen::MatrixXd period(info_.period_samples, static_cast<Eigen::Index>(info_.excitation.size()));
  read_columns(dataset, 0, period);
  if (!period.allFinite()) throw FormatError(path_, dataset.name, "contains a non-finite value");
  // The excitation of an incomplete run was ramped down, so it need not be periodic.
  if (dataset.rows > static_cast<std::uint64_t>(info_.period_samples) && which.complete)
    check_repetition(which, dataset, period);
  return period;
}

void Hdf5LogReader::check_repetition(const LogRun& run, const Dataset& dataset,
                                     const Eigen::MatrixXd& period) const {
  constexpr double kTolerance = 1e-9;  // of the peak: rounding of the writer, not drift
  const auto rows = static_cast<std::uint64_t>(period.rows());
  if (dataset.rows % rows != 0)
    fail_format(path_, dataset.name, "run {}: {} rows are not a whole number of periods of {}",
                run.name, dataset.rows, rows);
  if (period.size() == 0) return;
  const double peak = period.cwiseAbs().maxCoeff();
  const double tolerance = kTolerance * peak;
  Eigen::Index ahead = 0;
  Eigen::MatrixXd later(period.rows(), period.cols());
  for (std::uint64_t first = rows; first < dataset.rows; first += rows) {
    read_columns(dataset, first, later);
    // The last rows may be padding for lost ones.
    const bool last = first + rows == dataset.rows;
    const Eigen::Index count =
        last && ahead < period.rows() / 2 ? period.rows() - ahead : period.rows();
    const Eigen::Index row = first_other(later, period, ahead, tolerance, 0, count);
    if (row == count) continue;
    const Eigen::Index next =
        ahead_after_gap(later, period, ahead, tolerance, row, last ? count - kPadding : count);
    if (next != ahead) {
      ahead = next;
      continue;
    }
    Eigen::Index column = 0;
    const double largest =
        (later.row(row) - row_of(period, row, ahead)).cwiseAbs().maxCoeff(&column);
    fail_format(path_, dataset.name,
                "is not periodic: row {} of '{}' differs from the first period by {:.3g} (peak "
                "{:.3g}); check period_samples ({})",
                first + static_cast<std::uint64_t>(row), info_.excitation.names[column], largest,
                peak, info_.period_samples);
  }
}

void Hdf5LogReader::read_marked(const std::string& dataset, std::uint64_t first,
                                LogSamples& out) const {
  if (dataset.empty()) {
    out.marked.setZero();
    return;
  }
  std::vector<double> values(out.marked.size());
  {
    const std::lock_guard lock(hdf5_mutex());
    file_->read_rows(dataset, first, values.size(), values.data());
  }
  std::transform(values.begin(), values.end(), out.marked.data(), [](double value) {
    return value == kIrregularMark ? kIrregularMark : value != 0.0 ? kBadMark : std::uint8_t{0};
  });
}

void Hdf5LogReader::read(std::size_t run, std::uint64_t first, std::uint64_t count,
                         LogSamples& out) const {
  check_run_index(path_, runs_, run);
  const LogRun& which = runs_[run];
  const Run& place = places_[run];
  check_row_range(path_, which, first, count);
  resize_samples(info_, count, out);
  if (count == 0) return;
  read_columns(place.actuators, first, out.actuators);
  read_columns(place.sensors, first, out.sensors);
  read_marked(place.marked, first, out);
  if (!out.actuators.allFinite() || !out.sensors.allFinite())
    throw_not_finite(path_, info_, which, first, out, 0, out.marked.size());
}

}  // namespace stageid
