#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "acquisition/record/run_timing.hpp"

namespace stageid {

/// Names and units of one group of channels.
struct ChannelList {
  std::vector<std::string> names;
  std::vector<std::string> units;  ///< as many as names
  std::size_t size() const noexcept { return names.size(); }
  const std::string& name(std::ptrdiff_t i) const { return names[i]; }
  const std::string& unit(std::ptrdiff_t i) const { return units[i]; }
  friend bool operator==(const ChannelList&, const ChannelList&) = default;
};

/// Properties of a whole log.
struct LogInfo {
  double sample_rate_hz = 0.0;
  int period_samples = 0;
  int transient_periods = 0;
  ChannelList excitation;
  ChannelList actuators;
  ChannelList sensors;
  bool stamps = false;  ///< rows have a stamp word before the status word (slog_format.hpp)
  /// Configuration text, version, seeds, start time: provenance. A JSON object in native logs and logs converted
  /// from them; "{}" for other HDF5 logs.
  std::string metadata_json = "{}";
};

/// Checks a LogInfo: positive rate and period, at most 1 GiB for one period of the excitation,
/// transient_periods >= 0, one unit per name, at least one actuator and one sensor, no duplicate name within a
/// group.
/// @throws std::invalid_argument naming the field.
void check_log_info(const LogInfo& info);

/// True if both describe the same experiment: everything but the metadata and stamps is equal.
bool same_measurement(const LogInfo& a, const LogInfo& b) noexcept;

/// Counts of irregular cycles of a run.
struct RunHealth {
  std::uint64_t cycles = 0;
  std::uint64_t late = 0;
  std::uint64_t missing = 0;  ///< incomplete, stale, corrupt or link trouble
  std::uint64_t marked = 0;
  std::uint64_t irregular = 0;  ///< jitter beyond the limit; 0 in older logs
  std::uint64_t lost = 0;       ///< replaced by marked zeros in recover_log()
  std::int64_t largest_lateness_ns = 0;
  double seconds = 0.0;  ///< wall time of the run

  /// Adds the counts of another run; the larger lateness is kept.
  RunHealth& operator+=(const RunHealth& other) noexcept;
  friend bool operator==(const RunHealth&, const RunHealth&) = default;
};

/// Properties of one run.
struct LogRun {
  std::string name;           ///< "0000", for messages
  int realization = 0;        ///< 0-based
  int experiment = 0;         ///< 0-based
  std::uint64_t samples = 0;  ///< recorded rows
  bool complete = true;
  std::string started_utc;  ///< ISO 8601, may be empty
  RunHealth health;
  RunTiming timing;  ///< on the wall clock; empty in virtual time and in HDF5 logs
};

}  // namespace stageid
