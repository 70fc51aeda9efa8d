#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>

#include "hal/stage.hpp"

namespace stageid {

/// Waveforms that a node plays by itself: one period, samples x actuators, SI.
struct Waveforms {
  Eigen::MatrixXd samples;
  int periods = 1;
  int transient_periods = 0;
};

struct Trigger {
  std::int64_t t_start_ns = 0;  ///< 0: at once
};

enum class JobStatus : std::uint8_t { running, done, failed };

struct Progress {
  JobStatus status = JobStatus::running;
  std::uint64_t done = 0;  ///< bytes or samples
  std::uint64_t total = 0;
  std::string message;
};

/// Receives a downloaded trace in rows of actuators + sensors, SI, in order.
class TraceSink {
 public:
  virtual ~TraceSink() = default;
  virtual void rows(std::uint64_t first_cycle, std::span<const double> values) = 0;
};

/// The door for experiments that the node runs in its own closed loop: upload, arm, trigger,
/// download. A transfer that broke off is continued by calling it again.
class ResidentStage {
 public:
  virtual ~ResidentStage() = default;
  virtual const StageInfo& info() const noexcept = 0;
  virtual std::uint64_t depth_samples() const noexcept = 0;
  virtual Progress upload(const Waveforms& waveforms) = 0;  ///< verified by reading back
  virtual Progress arm(const Trigger& trigger) = 0;
  virtual Progress poll() = 0;
  virtual Progress download(TraceSink& sink) = 0;
};

}  // namespace stageid
