#include "tools/import_log.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>

#include "acquisition/convert_log.hpp"
#include "acquisition/slog_writer.hpp"
#include "excitation/counted.hpp"
#include "excitation/file_error.hpp"
#include "excitation/output_file.hpp"

namespace stageid {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A group of channels with all its samples.
struct Signals {
  ChannelList channels;
  RowMajor samples;
};

[[noreturn]] void fail(const ImportMap& map, const std::string& what) {
  throw FormatError(map.file, "", what);
}

/// As samples x channels: MATLAB's rows and columns are both vectors.
RowMajor as_columns(const ArrayList& arrays, const std::string& name) {
  const NamedArray& array = arrays.at(name);
  const std::vector<double> values = real_values(arrays, array);
  if (array.shape.size() > 2)
    throw FormatError(
        arrays.file, array.name,
        fmt::format("is {}; samples x channels must stand here", fmt::join(array.shape, " x ")));
  const bool vector = array.shape.size() < 2 || array.shape[0] == 1;
  const auto rows = static_cast<Eigen::Index>(vector ? values.size() : array.shape[0]);
  if (rows == 0) throw FormatError(arrays.file, array.name, "is empty; samples must stand here");
  return Eigen::Map<const RowMajor>(values.data(), rows,
                                    static_cast<Eigen::Index>(values.size()) / rows);
}

void name_channels(const ImportMap& map, const char* key, const ImportMap::Signals& group,
                   Signals& out) {
  const auto count = static_cast<std::size_t>(out.samples.cols());
  if (!group.names.empty()) out.channels.names = group.names;
  if (out.channels.names.size() != count)
    fail(map, fmt::format("{}: {} for {}; give names: [...]", key,
                          counted(out.channels.names.size(), "name"), counted(count, "channel")));
  out.channels.units = units_of(map, key, group.unit, count);
  if (group.scale.empty()) return;
  if (group.scale.size() != count)
    fail(map, fmt::format("{}: {} for {}; give one a channel", key,
                          counted(group.scale.size(), "scale"), counted(count, "channel")));
  for (std::size_t c = 0; c < count; ++c)
    out.samples.col(static_cast<Eigen::Index>(c)) *= group.scale[c];
}

Signals read_signals(const ArrayList& arrays, const ImportMap& map, const char* key,
                     const ImportMap::Signals& group) {
  Signals out;
  for (const std::string& name : group.arrays) {
    const RowMajor columns = as_columns(arrays, name);
    if (out.samples.cols() > 0 && columns.rows() != out.samples.rows())
      throw FormatError(arrays.file, name,
                        fmt::format("has {} samples; '{}' has {}", columns.rows(),
                                    group.arrays.front(), out.samples.rows()));
    const Eigen::Index first = out.samples.cols();
    out.samples.conservativeResize(columns.rows(), first + columns.cols());
    out.samples.rightCols(columns.cols()) = columns;
    // Several channels in one array have no names of their own.
    if (columns.cols() == 1) out.channels.names.push_back(name);
  }
  name_channels(map, key, group, out);
  return out;
}

struct Rows {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// The rows of a run, whole periods only.
Rows rows_of(const ArrayList& arrays, const ImportMap& map, const ImportMap::Run& run,
             Eigen::Index samples) {
  const auto period = static_cast<Eigen::Index>(map.period_samples);
  Rows rows{static_cast<Eigen::Index>(run.first_row), static_cast<Eigen::Index>(run.rows)};
  if (rows.first > samples || rows.count > samples - rows.first)
    fail(map, fmt::format("runs: rows {} to {} are asked for; {} has {}", rows.first,
                          rows.first + rows.count, arrays.file.string(), samples));
  if (rows.count == 0) rows.count = samples - rows.first;
  const Eigen::Index least = (static_cast<Eigen::Index>(map.transient_periods) + 1) * period;
  if (rows.count < least || rows.count % period != 0)
    fail(map, fmt::format("runs: {} are not {} and more of period_samples = {}, all "
                          "whole; give first_row and rows of a run",
                          counted(rows.count, "row"),
                          counted(map.transient_periods, "transient period"), period));
  return rows;
}

/// One period of the excitation: given as such, repeated exactly, or the mean behind the transient.
Eigen::MatrixXd period_of(const ArrayList& arrays, const ImportMap& map, const Signals& excitation,
                          const Rows& rows) {
  const auto period = static_cast<Eigen::Index>(map.period_samples);
  if (excitation.samples.rows() == period) return excitation.samples;
  if (rows.first + rows.count > excitation.samples.rows())
    throw FormatError(arrays.file, map.excitation.arrays.front(),
                      fmt::format("has {} samples; a run ends at row {}, or give one period of {}",
                                  excitation.samples.rows(), rows.first + rows.count, period));
  const RowMajor all = excitation.samples.middleRows(rows.first, rows.count);
  const bool mean = map.excitation_period == ImportMap::ExcitationPeriod::mean;
  const Eigen::Index first = mean ? static_cast<Eigen::Index>(map.transient_periods) * period : 0;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(period, all.cols());
  Eigen::Index periods = 0;
  for (Eigen::Index at = first; at < all.rows(); at += period, ++periods) {
    if (!mean && all.middleRows(at, period) != all.topRows(period))
      fail(map,
           fmt::format(
               "key 'excitation_period' is missing: the excitation does not repeat from row {} "
               "on; if it was measured write excitation_period: mean",
               rows.first + at));
    sum += all.middleRows(at, period);
  }
  return mean ? Eigen::MatrixXd(sum / static_cast<double>(periods))
              : Eigen::MatrixXd(all.topRows(period));
}

void require_finite(const ArrayList& arrays, const char* key, const Signals& signals) {
  for (Eigen::Index k = 0; k < signals.samples.rows(); ++k)
    if (!signals.samples.row(k).allFinite())
      throw FormatError(arrays.file, "", fmt::format("{}: sample {} is not finite", key, k));
}

LogInfo info_of(const ImportMap& map, const Signals& excitation, const Signals& actuators,
                const Signals& sensors) {
  LogInfo info;
  info.sample_rate_hz = map.sample_rate_hz;
  info.period_samples = static_cast<int>(map.period_samples);
  info.transient_periods = static_cast<int>(map.transient_periods);
  info.excitation = excitation.channels;
  info.actuators = actuators.channels;
  info.sensors = sensors.channels;
  try {
    check_log_info(info);
  } catch (const std::invalid_argument& error) {
    fail(map, error.what());
  }
  return info;
}

void write_run(SlogWriter& writer, const ImportMap::Run& from, const Rows& rows,
               const Eigen::MatrixXd& period, const Signals& actuators, const Signals& sensors) {
  constexpr Eigen::Index kPieceRows = 4096;
  LogRun run;
  run.realization = static_cast<int>(from.realization);
  run.experiment = static_cast<int>(from.experiment);
  run.health.cycles = static_cast<std::uint64_t>(rows.count);
  writer.begin_run(run, period);
  for (Eigen::Index at = 0; at < rows.count; at += kPieceRows) {
    const Eigen::Index count = std::min(kPieceRows, rows.count - at);
    write_samples(writer, {actuators.samples.middleRows(rows.first + at, count),
                           sensors.samples.middleRows(rows.first + at, count),
                           {}});
  }
  run.samples = static_cast<std::uint64_t>(rows.count);
  writer.end_run(run);
}

}  // namespace

void import_log(const ArrayList& arrays, const ImportMap& map,
                const std::filesystem::path& output) {
  const std::string ending = output.extension().string();
  if (ending != ".slog" && ending != ".h5" && ending != ".hdf5")
    throw std::invalid_argument(fmt::format(
        "{}: logs are not imported as '{}'; there are .slog and .h5", output.string(), ending));
  const Signals excitation = read_signals(arrays, map, "excitation", map.excitation);
  const Signals actuators = read_signals(arrays, map, "actuators", map.actuators);
  const Signals sensors = read_signals(arrays, map, "sensors", map.sensors);
  require_finite(arrays, "excitation", excitation);
  require_finite(arrays, "actuators", actuators);
  require_finite(arrays, "sensors", sensors);
  if (actuators.samples.rows() != sensors.samples.rows())
    fail(map, fmt::format("actuators have {} samples, sensors {}; all must have the same",
                          actuators.samples.rows(), sensors.samples.rows()));
  const std::vector<ImportMap::Run> runs =
      map.runs.empty() ? std::vector<ImportMap::Run>(1) : map.runs;
  OutputFile scratch(output);
  std::filesystem::remove(scratch.path());  // a log is never written over
  SlogWriter writer =
      SlogWriter::create(scratch.path(), info_of(map, excitation, actuators, sensors));
  for (const ImportMap::Run& run : runs) {
    const Rows rows = rows_of(arrays, map, run, actuators.samples.rows());
    write_run(writer, run, rows, period_of(arrays, map, excitation, rows), actuators, sensors);
  }
  writer.close(0, "imported");
  if (ending == ".slog")
    scratch.commit();
  else
    convert_log(*open_log(scratch.path()), output);
}

}  // namespace stageid
