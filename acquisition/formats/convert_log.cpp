#include "acquisition/formats/convert_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <mutex>
#include <string>
#include <string_view>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/hdf5_matrices.hpp"
#include "acquisition/files/output_file.hpp"
#include "acquisition/formats/hdf5_log.hpp"
#include "acquisition/slog/slog_index.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_writer.hpp"

namespace stageid {

ConvertProgress::ConvertProgress(const LogReader& reader, const ConvertOptions& options)
    : options_(options) {
  for (const LogRun& run : reader.runs())
    if (wanted(run)) total_ += run.samples;
}

bool ConvertProgress::wanted(const LogRun& run) const noexcept {
  return run.complete || (options_.incomplete_runs && run.samples > 0);
}

void ConvertProgress::add(std::uint64_t rows) {
  done_ += rows;
  if (options_.progress) options_.progress(done_, total_);
}

namespace {

constexpr std::uint64_t kPieceRows = 8192;

/// Reads a run piece by piece: take(first row, number of rows, samples).
template <typename Take>
void read_pieces(const LogReader& reader, std::size_t run, ConvertProgress& progress, Take take) {
  LogSamples samples;
  const std::uint64_t rows = reader.runs()[run].samples;
  for (std::uint64_t first = 0; first < rows; first += kPieceRows) {
    const std::uint64_t count = std::min(kPieceRows, rows - first);
    reader.read(run, first, count, samples);
    take(first, count, samples);
    progress.add(count);
  }
}

// HDF5 ---------------------------------------------------------------------------------------

void write_channels(Hdf5File& file, const std::string& name, const ChannelList& channels) {
  const std::string dataset = "/channels/" + name;
  file.write_texts(dataset, channels.names);
  file.write_attribute(dataset, "unit", channels.units);
}

void write_hdf5_head(Hdf5File& file, const LogInfo& info) {
  file.write_attribute("/", "format", std::string("stageid-log"));
  file.write_attribute("/", "format_version", 1LL);
  file.write_attribute("/", "sample_rate_hz", info.sample_rate_hz);
  file.write_attribute("/", "period_samples", static_cast<long long>(info.period_samples));
  file.write_attribute("/", "transient_periods", static_cast<long long>(info.transient_periods));
  file.write_attribute("/", "metadata_json", info.metadata_json);
  file.create_group("/channels");
  write_channels(file, "excitation", info.excitation);
  write_channels(file, "actuators", info.actuators);
  write_channels(file, "sensors", info.sensors);
  file.create_group("/runs");
}

void write_run_attributes(Hdf5File& file, const std::string& group, const LogRun& run) {
  const auto count = [&](const char* name, std::uint64_t value) {
    file.write_attribute(group, name, static_cast<long long>(value));
  };
  file.write_attribute(group, "realization", static_cast<long long>(run.realization));
  file.write_attribute(group, "experiment", static_cast<long long>(run.experiment));
  file.write_attribute(group, "complete", run.complete ? 1LL : 0LL);
  file.write_attribute(group, "started_utc", run.started_utc);
  count("late_cycles", run.health.late);
  count("missing_cycles", run.health.missing);
  count("marked_samples", run.health.marked);
  count("irregular_samples", run.health.irregular);
}

void convert_run_to_hdf5(const LogReader& reader, std::size_t run, Hdf5File& file,
                         ConvertProgress& progress) {
  const LogInfo& info = reader.info();
  const std::string group = "/runs/" + slog_run_name(run);
  const Eigen::MatrixXd excitation = reader.excitation(run);
  {
    const std::lock_guard lock(hdf5_mutex());
    file.create_group(group);
    write_run_attributes(file, group, reader.runs()[run]);
    write_matrix(file, group + "/excitation", excitation);
    file.create_growing(group + "/actuators", info.actuators.size(), H5T_IEEE_F64LE, kPieceRows);
    file.create_growing(group + "/sensors", info.sensors.size(), H5T_IEEE_F64LE, kPieceRows);
    file.create_growing(group + "/marked", 0, H5T_STD_U8LE, kPieceRows);
  }
  RowMajor<double> rows;
  // The reader takes the lock itself if necessary.
  read_pieces(reader, run, progress,
              [&](std::uint64_t, std::uint64_t count, const LogSamples& samples) {
                const std::lock_guard lock(hdf5_mutex());
                rows = samples.actuators;
                file.append_rows(group + "/actuators", count, rows.data());
                rows = samples.sensors;
                file.append_rows(group + "/sensors", count, rows.data());
                file.append_rows(group + "/marked", count, samples.marked.data());
              });
}

void convert_to_hdf5(const LogReader& reader, const std::filesystem::path& temporary,
                     const std::filesystem::path& to, const ConvertOptions& options) {
  ConvertProgress progress(reader, options);
  std::unique_lock lock(hdf5_mutex());
  Hdf5File file = Hdf5File::create(temporary, to);
  write_hdf5_head(file, reader.info());
  for (std::size_t run = 0; run < reader.runs().size(); ++run) {
    if (!progress.wanted(reader.runs()[run])) continue;
    lock.unlock();
    convert_run_to_hdf5(reader, run, file, progress);
    lock.lock();
  }
  file.close();
}

// CSV ----------------------------------------------------------------------------------------

/// The text of an output, written in large pieces.
class CsvFile {
 public:
  explicit CsvFile(OutputFile& output) : output_(output) { text_.reserve(kFlushBytes + 4096); }
  void text(std::string_view text) { text_ += text; }

  /// A quoted cell: names may contain commas and quotes.
  void quoted(const std::string& text) {
    text_ += '"';
    for (const char c : text) {
      if (c == '"') text_ += '"';
      text_ += c;
    }
    text_ += '"';
  }

  template <typename Number>
  void number(Number value) {
    char digits[32];
    const auto end = std::to_chars(std::begin(digits), std::end(digits), value).ptr;
    text_.append(digits, end);
  }

  void end_line() {
    text_ += '\n';
    if (text_.size() >= kFlushBytes) flush();
  }

  void flush() {
    output_.append(text_);
    text_.clear();
  }

 private:
  static constexpr std::size_t kFlushBytes = std::size_t{1} << 18;

  OutputFile& output_;
  std::string text_;
};

void write_csv_head(CsvFile& csv, const LogInfo& info) {
  csv.text("run,realization,experiment,time_s,marked");
  const auto names = [&](const char* group, const ChannelList& channels) {
    for (std::size_t c = 0; c < channels.size(); ++c) {
      csv.text(",");
      csv.quoted(fmt::format("{} {} [{}]", group, channels.names[c], channels.units[c]));
    }
  };
  names("excitation", info.excitation);
  names("actuator", info.actuators);
  names("sensor", info.sensors);
  csv.end_line();
}

template <typename Row>
void write_cells(CsvFile& csv, const Row& row) {
  for (const double value : row) {
    csv.text(",");
    csv.number(value);
  }
}

void convert_run_to_csv(const LogReader& reader, std::size_t run, CsvFile& csv,
                        ConvertProgress& progress) {
  const LogInfo& info = reader.info();
  const LogRun& which = reader.runs()[run];
  const RowMajor<double> excitation = reader.excitation(run);
  const std::string head = fmt::format("{},{},{},", run, which.realization, which.experiment);
  const auto write = [&](std::uint64_t first, std::uint64_t count, const LogSamples& samples) {
    for (Eigen::Index r = 0; r < static_cast<Eigen::Index>(count); ++r) {
      const std::uint64_t row = first + static_cast<std::uint64_t>(r);
      csv.text(head);
      csv.number(static_cast<double>(row) / info.sample_rate_hz);
      csv.text(fmt::format(",{}", samples.marked[r]));
      write_cells(csv, excitation.row(row % static_cast<std::uint64_t>(info.period_samples)));
      write_cells(csv, samples.actuators.row(r));
      write_cells(csv, samples.sensors.row(r));
      csv.end_line();
    }
  };
  read_pieces(reader, run, progress, write);
}

void convert_to_csv(const LogReader& reader, OutputFile& output, const ConvertOptions& options) {
  ConvertProgress progress(reader, options);
  CsvFile csv(output);
  write_csv_head(csv, reader.info());
  for (std::size_t run = 0; run < reader.runs().size(); ++run) {
    if (progress.wanted(reader.runs()[run])) convert_run_to_csv(reader, run, csv, progress);
  }
  csv.flush();
}

// native -------------------------------------------------------------------------------------

void convert_run_to_slog(const LogReader& reader, std::size_t run, SlogWriter& writer,
                         ConvertProgress& progress) {
  const LogRun& which = reader.runs()[run];
  writer.begin_run(which, reader.excitation(run));
  read_pieces(reader, run, progress, [&](std::uint64_t, std::uint64_t, const LogSamples& samples) {
    write_samples(writer, samples);
  });
  writer.end_run(which);
}

void convert_to_slog(const LogReader& reader, const std::filesystem::path& temporary,
                     const ConvertOptions& options) {
  ConvertProgress progress(reader, options);
  std::filesystem::remove(temporary);  // the writer does not overwrite a log
  SlogWriter writer = SlogWriter::create(temporary, reader.info());
  for (std::size_t run = 0; run < reader.runs().size(); ++run)
    if (progress.wanted(reader.runs()[run])) convert_run_to_slog(reader, run, writer, progress);
  writer.close(0, "converted");
}

}  // namespace

void convert_log(const LogReader& reader, const std::filesystem::path& to,
                 const ConvertOptions& options) {
  const std::string extension = to.extension().string();
  const bool hdf5 = extension == ".h5" || extension == ".hdf5";
  const bool native = extension == ".slog";
  if (!hdf5 && !native && extension != ".csv")
    fail_request(
        "{}: unsupported file extension; use .h5 or .hdf5 (HDF5), .csv (text), .mat (MATLAB) or "
        ".slog",
        to.string());
  if (native && dynamic_cast<const SlogReader*>(&reader) != nullptr)
    fail_request("{}: is already a native log; use 'stageid log recover' to copy its intact parts",
                 reader.path().string());
  OutputFile output(to);
  if (hdf5) {
    convert_to_hdf5(reader, output.path(), to, options);
  } else if (native) {
    convert_to_slog(reader, output.path(), options);
  } else {
    convert_to_csv(reader, output, options);
  }
  output.commit();
}

}  // namespace stageid
