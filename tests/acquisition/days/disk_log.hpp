#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/slog/slog_index.hpp"
#include "acquisition/slog/slog_writer.hpp"

namespace stageid::test {

/// A log on a disk that may fail. It knows what was synchronized when.
class DiskLog final : public RunWriter {
 public:
  struct Synchronized {
    std::uint64_t bytes = 0;
    int complete_runs = 0;
  };

  static constexpr std::size_t kBlockRows = 100;

  DiskLog(SlogWriter& log, int failing_call)
      : log_(log), calls_left_(failing_call), synchronized_({{log.bytes(), 0}}) {}

  const LogInfo& info() const noexcept override { return log_.info(); }
  void begin_run(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& excitation) override {
    use();
    log_.begin_run(run, excitation);
  }
  void write(std::span<const double> rows) override {
    use();
    // Smaller blocks than those of real logs, so that few of them can be lost.
    const std::size_t block = kBlockRows * slog_row_words(info());
    for (; !rows.empty(); rows = rows.subspan(std::min(block, rows.size())))
      log_.write(rows.first(std::min(block, rows.size())));
  }
  void end_run(const LogRun& run) override {
    use();
    log_.end_run(run);
    complete_runs_ += run.complete ? 1 : 0;
  }
  void synchronize() override {
    log_.synchronize();
    synchronized_.push_back({log_.bytes(), complete_runs_});
  }

  /// The last state of the medium that is certain when so many bytes were written.
  Synchronized before(std::uint64_t bytes) const {
    Synchronized last = synchronized_.front();
    for (const Synchronized& state : synchronized_)
      if (state.bytes <= bytes) last = state;
    return last;
  }
  std::uint64_t bytes_before() const { return synchronized_.front().bytes; }

 private:
  void use() {
    if (calls_left_-- == 0) throw FileError("the log cannot be written: the disk is full");
  }

  SlogWriter& log_;
  int calls_left_;
  int complete_runs_ = 0;
  std::vector<Synchronized> synchronized_;
};

}  // namespace stageid::test
