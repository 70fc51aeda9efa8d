#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "acquisition/loop/run_observer.hpp"
#include "acquisition/record/event_log.hpp"
#include "acquisition/slog/slog_format.hpp"

namespace stageid {

/// The fields that name the run of an event.
std::vector<EventField> event_place(int realization, int experiment);

/// Writes events derived from the rows of a run: begin, end, and every sequence of bad cycles ("miss"). After
/// kMissesTold sequences of one run, only their number is written at the end of the run, so that a failing stage
/// cannot fill the disk.
class EventRecorder final : public RunObserver {
 public:
  static constexpr std::uint64_t kMissesTold = 200;

  explicit EventRecorder(EventLog& events) noexcept : events_(events) {}

  void begin_run(const LogRun& run) noexcept override;
  void rows(std::span<const double> rows, std::size_t words) noexcept override;
  void end_run(const LogRun& run) noexcept override;

 private:
  struct Miss {
    std::uint64_t cycle = 0;
    std::uint64_t cycles = 0;
    std::uint8_t outcome = 0;
    std::uint32_t lateness_ns = 0;
  };
  void take(const SampleStatus& status) noexcept;
  void tell_miss() noexcept;

  EventLog& events_;
  LogRun run_;
  std::uint64_t cycle_ = 0;
  std::uint64_t misses_ = 0;
  std::optional<Miss> open_;
};

}  // namespace stageid
