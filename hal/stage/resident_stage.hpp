#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>

#include "hal/stage/stage.hpp"

namespace stageid {

/// Waveforms that a node plays by itself: one period, samples x actuators, SI.
struct Waveforms {
  Eigen::MatrixXd samples;
  int periods = 1;
  int transient_periods = 0;
};

struct Trigger {
  std::int64_t t_start_ns = 0;  ///< 0: at once
  std::uint64_t run_seed = 0;   ///< as CyclicStage::start()
  double ramp_s = 0.1;          ///< behind the last sample, not recorded: excitation to zero
};

enum class JobStatus : std::uint8_t { running, done, failed };

struct JobProgress {
  JobStatus status = JobStatus::running;
  std::uint64_t done = 0;  ///< bytes or samples
  std::uint64_t total = 0;
  std::string message;
  Outcome outcome = Outcome::ok;  ///< why it failed: Outcome::limit or another
};

/// Receives a downloaded trace in rows of actuators + sensors, SI, in order.
class TraceSink {
 public:
  virtual ~TraceSink() = default;
  /// u[n] and y[n] of cycle n, and the Outcome that gave y[n], one a row.
  virtual void rows(std::uint64_t first_cycle, std::span<const double> values,
                    std::span<const Outcome> outcomes) = 0;
};

/// The door for experiments that the node runs in its own closed loop: upload, arm, download.
///
/// A transfer that broke off is continued by calling it again: what has arrived is not sent twice.
/// Every function @throws StageError if the node does not answer, refuses, or is in fault.
class ResidentStage {
 public:
  virtual ~ResidentStage() = default;
  virtual const StageInfo& info() const noexcept = 0;
  /// Rows that the node's trace has room for.
  virtual std::uint64_t depth_samples() const noexcept = 0;
  /// Brings the waveforms into the node and verifies them by reading them back.
  /// @throws std::invalid_argument if they do not fit the stage or its memory.
  virtual JobProgress upload(const Waveforms& waveforms) = 0;
  /// Brings the node to operation and starts the run that was uploaded.
  virtual JobProgress arm(const Trigger& trigger) = 0;
  /// How far the run is; `failed` says why in `message`.
  virtual JobProgress poll() = 0;
  /// The recorded rows, from those on that earlier calls gave to a sink already.
  virtual JobProgress download(TraceSink& sink) = 0;
  /// Ends a run, disables the stage. Idempotent.
  virtual void stop() noexcept = 0;
};

}  // namespace stageid
