#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "estimation/modal/model_spectra.hpp"

namespace stageid {

/// A period of a watched log.
struct WatchedPeriod {
  PeriodSpectra spectra;
  std::size_t run = 0;       ///< index into the log's
  std::uint64_t period = 0;  ///< of the run, transient periods included
  double time_s = 0.0;       ///< end of the period, in recorded time since the start of the log
  bool other_excitation = false;  ///< than that of the period before
};

/// The measured periods of a log in order, also while it is being written.
class WatchSource {
 public:
  /// @param band_hz lines outside are not read; on the others, those that the first run excites
  /// @param follow the log is being written
  /// @throws FileError, FormatError; std::invalid_argument if the log does not fit the model
  WatchSource(const AdditiveModel& model, std::filesystem::path log,
              const std::array<double, 2>& band_hz, bool follow);

  /// Whether a log that is being written has a run, or has ended.
  static bool has_begun(const std::filesystem::path& log);

  const LogInfo& info() const { return log_->info(); }
  std::string started_utc() const { return log_->runs().front().started_utc; }  ///< may be empty
  const Eigen::VectorXd& frequency_hz() const noexcept { return frequency_hz_; }
  /// The next period; none at the end of the log, or at present if the log is being written.
  std::optional<WatchedPeriod> next();
  /// Reads what was written since. @returns false if the log has ended and next() has returned all of it
  bool refresh();
  std::uint64_t skipped() const noexcept { return skipped_; }  ///< periods with marked samples
  /// Whether the log has ended, but not all of its runs were completed.
  bool was_stopped_early() const;

 private:
  void open(bool follow);
  bool has_ended() const;

  std::filesystem::path file_;
  std::unique_ptr<LogReader> log_;
  SlogReader* growing_ = nullptr;  // log_, if it is being written
  std::optional<ModelSpectra> spectra_;
  Eigen::VectorXd frequency_hz_;
  Eigen::MatrixXd excitation_;  // of the current run
  std::size_t run_ = 0;
  std::uint64_t period_ = 0;
  std::uint64_t rows_before_ = 0;  // of earlier runs
  std::uint64_t skipped_ = 0;
  bool other_excitation_ = false;
};

}  // namespace stageid
