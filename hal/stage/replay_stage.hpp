#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "hal/stage/stage.hpp"

namespace stageid {

/// Source of recorded samples for ReplayStage; hal does not depend on log files.
class ReplaySource {
 public:
  virtual ~ReplaySource() = default;
  virtual int runs() const = 0;
  /// Loads run `run` completely: u is actuators x samples, y sensors x samples, marked size samples.
  virtual void load(int run, Eigen::MatrixXd& u, Eigen::MatrixXd& y, Eigen::VectorXi& marked) = 0;
};

/// Returns the recorded measurements at the recorded cycles and compares the commands with the recorded
/// ones: a regression test of everything above the stage. Each start() selects the next run.
///
/// exchange() compares u[n] with the recorded one and returns y[n+1]; with the last u of the record it holds
/// the last y. After that it returns link_down. A marked sample gives Outcome::late; a marked first sample has
/// no valid bits.
class ReplayStage final : public CyclicStage {
 public:
  /// @throws std::invalid_argument if there is no source, or the tolerance is negative or not
  /// finite.
  ReplayStage(StageInfo info, std::unique_ptr<ReplaySource> source, double tolerance_n);

  const StageInfo& info() const noexcept override { return info_; }
  /// @throws StageError if the source has no further run, or if the run does not fit the channels.
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;

  /// Number of commands, over all runs and channels, that differ by more than the tolerance.
  std::uint64_t mismatches() const noexcept { return mismatches_; }
  double largest_mismatch_n() const noexcept { return largest_mismatch_n_; }

 private:
  void compare(const Outputs& outputs) noexcept;
  void give(Inputs& inputs, Eigen::Index sample) const noexcept;

  StageInfo info_;
  std::unique_ptr<ReplaySource> source_;
  double tolerance_n_;
  int run_ = -1;
  std::uint64_t cycle_ = 0;
  Eigen::MatrixXd u_;
  Eigen::MatrixXd y_;
  Eigen::VectorXi marked_;
  std::uint64_t mismatches_ = 0;
  double largest_mismatch_n_ = 0.0;
};

}  // namespace stageid
