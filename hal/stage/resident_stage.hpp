#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "hal/stage/stage.hpp"

namespace stageid {

/// Waveforms for a resident experiment: one period, samples x actuators, SI.
struct Waveforms {
  Eigen::MatrixXd samples;
  int periods = 1;
  int transient_periods = 0;
};

struct Trigger {
  std::int64_t t_start_ns = 0;  ///< 0: immediately
  std::uint64_t run_seed = 0;   ///< as CyclicStage::start()
  double ramp_s = 0.1;          ///< after the last sample, not recorded: excitation ramps to zero
};

enum class JobStatus : std::uint8_t { running, done, failed };

struct JobProgress {
  JobStatus status = JobStatus::running;
  std::uint64_t done = 0;  ///< bytes or samples
  std::uint64_t total = 0;
  std::string message;
  Outcome outcome = Outcome::ok;  ///< reason of a failure: Outcome::limit or another
};

/// Receives a downloaded trace in order: rows of u[n] and y[n], SI, and one Outcome of y[n] per row.
using TraceSink =
    std::function<void(std::span<const double> values, std::span<const Outcome> outcomes)>;

/// Interface for experiments that the node runs in its own closed loop: upload, arm, download.
///
/// Calling an interrupted transfer again resumes it; received data are not sent twice.
/// Every function @throws StageError if the node does not answer, refuses, or is in fault.
class ResidentStage {
 public:
  virtual ~ResidentStage() = default;
  virtual const StageInfo& info() const noexcept = 0;
  /// Capacity of the node's trace in rows.
  virtual std::uint64_t depth_samples() const noexcept = 0;
  /// Sends the waveforms to the node and verifies them by reading them back.
  /// @throws std::invalid_argument if they do not fit the stage or its memory.
  virtual JobProgress upload(const Waveforms& waveforms) = 0;
  /// Enables the node and starts the run that was uploaded.
  virtual JobProgress arm(const Trigger& trigger) = 0;
  /// Progress of the run; if `failed`, `message` contains the reason.
  virtual JobProgress poll() = 0;
  /// The recorded rows, starting after those that earlier calls passed to a sink.
  virtual JobProgress download(const TraceSink& sink) = 0;
  /// Ends a run, disables the stage. Idempotent.
  virtual void stop() noexcept = 0;
};

}  // namespace stageid
