#pragma once

#include <filesystem>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "acquisition/slog/slog_index.hpp"

namespace stageid {

/// Reads the native log. Opening reads block headers only; read() checks the CRC of every block that it uses.
/// All functions may be called from several threads at once.
class SlogReader final : public LogReader {
 public:
  /// See open_log(). With SlogScanDepth::payloads, every byte is read and checked here.
  /// @throws FileError, FormatError
  explicit SlogReader(const std::filesystem::path& file, bool damaged_is_error = true,
                      SlogScanDepth depth = SlogScanDepth::headers);

  const std::filesystem::path& path() const noexcept override { return source_.path(); }
  const LogInfo& info() const noexcept override { return indexer_.index().info; }
  const std::vector<LogRun>& runs() const noexcept override { return runs_; }
  Eigen::MatrixXd excitation(std::size_t run) const override;
  void read(std::size_t run, std::uint64_t first, std::uint64_t count,
            LogSamples& out) const override;

  /// The damaged parts; empty unless opened with damaged_is_error = false.
  std::vector<LogDamage> damage() const;

  std::uint64_t intact_blocks() const noexcept { return indexer_.index().blocks; }

  /// Exit status and message of the experiment, if the log was closed properly.
  const std::optional<SlogEnd>& end() const noexcept { return indexer_.index().end; }

  /// Takes what was written since. Not while another thread reads. @throws the same as the constructor
  void update();

 private:
  struct Target;
  const SlogRunIndex& run_index(std::size_t run) const;
  void read_block(const SlogRunIndex& run, const SlogBlock& block, const Target& target) const;

  void scan();

  SlogSource source_;
  SlogScanner scanner_;
  SlogIndexer indexer_;
  std::vector<LogRun> runs_;
};

}  // namespace stageid
