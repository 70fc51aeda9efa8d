#include "acquisition/slog/slog_writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <optional>
#include <stdexcept>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/slog/slog_appender.hpp"
#include "acquisition/slog/slog_index.hpp"
#include "acquisition/slog/slog_json.hpp"
#include "acquisition/slog/slog_scan.hpp"

namespace stageid {

namespace {

/// Copies everything after `offset` to a new file FILE.damaged (.2, .3 ... if it exists).
std::filesystem::path save_tail(const SlogSource& source, std::uint64_t offset) {
  std::filesystem::path saved;
  FileDescriptor out;
  for (int attempt = 1; !out; ++attempt) {
    saved = source.path();
    saved += attempt == 1 ? std::string(".damaged") : fmt::format(".damaged.{}", attempt);
    out = FileDescriptor(::open(saved.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
    if (!out && errno != EEXIST)
      fail_file(
          saved,
          "cannot be created to keep the damaged end of the log; make the directory writable");
  }
  source.read_pieces(offset, source.bytes(), [&](std::span<const std::byte> piece) {
    if (!write_whole(out, {reinterpret_cast<const char*>(piece.data()), piece.size()}))
      fail_file(saved, "cannot be written; free some space");
  });
  if (::fsync(out.get()) != 0) fail_file(saved, "cannot be flushed to disk; check the disk");
  return saved;
}

/// End of the intact blocks, if only the end of the file is damaged.
std::uint64_t intact_bytes(const SlogSource& source, const SlogScan& scan, const SlogIndex& index) {
  const std::uint64_t end = scan.blocks.back().end();
  const bool only_tail = index.damage.empty() || index.damage.front().offset >= end;
  if (only_tail) return end;
  fail_format(source.path(), "",
              "damaged at byte {} but intact after it: {}; run 'stageid log recover' to write a "
              "new file, then resume that file",
              index.damage.front().offset, index.damage.front().what);
}

}  // namespace

struct SlogWriter::State {
  LogInfo info;
  std::string info_json;
  SlogAppender appender;
  std::uint32_t runs = 0;  ///< number of runs begun in the whole file
  std::optional<LogRun> open_run;
  std::uint64_t acknowledged_rows = 0;

  std::uint32_t row_words() const noexcept { return slog_row_words(info); }
  SlogBlockHeader header(SlogBlockType type) const {
    return slog_header(type, open_run ? runs - 1 : 0);
  }
  LogRun& run(const char* caller) {
    if (open_run) return *open_run;
    fail_request("SlogWriter: {} before begin_run", caller);
  }
};

SlogWriter::SlogWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SlogWriter::SlogWriter(SlogWriter&&) noexcept = default;
SlogWriter& SlogWriter::operator=(SlogWriter&&) noexcept = default;

// Without close() the log has no end block, and readers report that its writer was interrupted.
SlogWriter::~SlogWriter() = default;

SlogWriter SlogWriter::create(const std::filesystem::path& file, const LogInfo& info) {
  check_log_info(info);
  std::string json = to_json(info);
  auto state = std::unique_ptr<State>(
      new State{info, std::move(json), SlogAppender::create(file), 0, std::nullopt, 0});
  state->appender.append(state->header(SlogBlockType::log), state->info_json);
  state->appender.synchronize();  // readers need it for all blocks that follow
  return SlogWriter(std::move(state));
}

SlogWriter SlogWriter::resume(const std::filesystem::path& file, const LogInfo& info) {
  check_log_info(info);
  SlogAppender appender = SlogAppender::open_existing(file);  // locked before it is read
  const SlogSource source(file);
  const SlogScan scan = scan_slog(source, SlogScanDepth::payloads);
  const SlogIndex index = index_slog(source, scan);
  if (!same_measurement(index.info, info))
    throw FormatError(file, "",
                      "was written for a different experiment (sample rate, period or channels); "
                      "resume with the original configuration, or write a new log");
  const std::uint64_t end = intact_bytes(source, scan, index);
  if (end < source.bytes()) save_tail(source, end);
  appender.continue_at(end, scan.log_id, index.next_sequence);
  std::uint32_t runs = 0;
  for (const SlogBlock& block : scan.blocks) {
    if (block.header.is(SlogBlockType::run_begin)) runs = block.header.run + 1;
  }
  LogInfo continued = info;
  continued.stamps = index.info.stamps;  // all rows of a file have the same width
  std::string json = to_json(continued);
  return SlogWriter(std::unique_ptr<State>(new State{std::move(continued), std::move(json),
                                                     std::move(appender), runs, std::nullopt, 0}));
}

void SlogWriter::begin_run(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& excitation) {
  State& state = *state_;
  if (state.open_run) throw std::invalid_argument("SlogWriter: begin_run inside a run");
  if (excitation.rows() != state.info.period_samples ||
      excitation.cols() != static_cast<Eigen::Index>(state.info.excitation.size()) ||
      !excitation.allFinite())
    fail_request(
        "SlogWriter: the excitation is {} x {}; expected one period, {} x {}, of finite numbers",
        excitation.rows(), excitation.cols(), state.info.period_samples,
        state.info.excitation.size());
  SlogRunBegin begin{run, {}};
  std::vector<double> stored;
  for (Eigen::Index column = 0; column < excitation.cols(); ++column) {
    if (excitation.col(column).isZero(0.0)) continue;
    begin.excitation_columns.push_back(static_cast<int>(column));
    stored.insert(stored.end(), excitation.col(column).begin(), excitation.col(column).end());
  }
  state.appender.append(state.header(SlogBlockType::log), state.info_json);
  state.open_run = run;
  state.open_run->samples = 0;
  ++state.runs;
  state.appender.append(state.header(SlogBlockType::run_begin), run_begin_json(begin));
  if (stored.empty()) return;
  SlogBlockHeader header = state.header(SlogBlockType::excitation);
  header.rows = static_cast<std::uint32_t>(excitation.rows());
  header.cols = static_cast<std::uint32_t>(begin.excitation_columns.size());
  state.appender.append(header, std::as_bytes(std::span(stored)));
}

void SlogWriter::write(std::span<const double> rows) {
  State& state = *state_;
  LogRun& run = state.run("write");
  if (rows.empty()) return;
  if (rows.size() % state.row_words() != 0)
    fail_request("SlogWriter: {} words are not a whole number of rows of {}", rows.size(),
                 state.row_words());
  SlogBlockHeader header = state.header(SlogBlockType::samples);
  header.cols = state.row_words();
  header.rows = static_cast<std::uint32_t>(rows.size() / state.row_words());
  header.first_row = run.samples;
  state.appender.append(header, std::as_bytes(rows));
  run.samples += header.rows;
  state.acknowledged_rows += header.rows;
}

void SlogWriter::end_run(const LogRun& run) {
  State& state = *state_;
  LogRun end = state.run("end_run");
  end.complete = run.complete;
  end.health = run.health;
  end.timing = run.timing;
  state.appender.append(state.header(SlogBlockType::run_end), run_end_json(end));
  state.open_run.reset();
}

void SlogWriter::synchronize() { state_->appender.synchronize(); }

const LogInfo& SlogWriter::info() const noexcept { return state_->info; }

std::uint64_t SlogWriter::acknowledged_rows() const noexcept { return state_->acknowledged_rows; }

std::uint64_t SlogWriter::bytes() const noexcept { return state_->appender.bytes(); }

void SlogWriter::close(int exit_code, const char* message) {
  State& state = *state_;
  state.open_run.reset();  // a run without end is incomplete
  state.appender.append(state.header(SlogBlockType::end), to_json(SlogEnd{exit_code, message}));
  state.appender.close();
}

void write_samples(SlogWriter& writer, const LogSamples& samples) {
  const Eigen::Index n_u = samples.actuators.cols();
  const Eigen::Index n_y = samples.sensors.cols();
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> words(
      samples.actuators.rows(), n_u + n_y + 1);
  words.leftCols(n_u) = samples.actuators;
  words.middleCols(n_u, n_y) = samples.sensors;
  for (Eigen::Index r = 0; r < words.rows(); ++r) {
    const std::uint8_t mark = samples.marked.size() > 0 ? samples.marked[r] : 0;
    words(r, n_u + n_y) = std::bit_cast<double>(
        pack_status({.marked = mark != 0, .irregular = mark == kIrregularMark}));
  }
  writer.write({words.data(), static_cast<std::size_t>(words.size())});
}

}  // namespace stageid
