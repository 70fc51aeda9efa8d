#include "acquisition/record/log_info.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"

namespace stageid {

namespace {

constexpr std::uint64_t kLargestPeriodBytes = std::uint64_t{1} << 30;

void check_channels(const ChannelList& channels, const char* group) {
  if (channels.units.size() != channels.names.size())
    fail_request("log: {} has {} and {}; give one unit per name", group,
                 counted(channels.names.size(), "name"), counted(channels.units.size(), "unit"));
  std::vector<std::string> sorted = channels.names;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end()) fail_request("log: {}: duplicate channel name '{}'", group, *twice);
}

}  // namespace

void check_log_info(const LogInfo& info) {
  if (!(info.sample_rate_hz > 0.0) || !std::isfinite(info.sample_rate_hz))
    fail_request("log: sample_rate_hz is {}; must be positive and finite", info.sample_rate_hz);
  if (info.period_samples <= 0)
    fail_request("log: period_samples is {}; must be positive", info.period_samples);
  const std::uint64_t period_bytes =
      static_cast<std::uint64_t>(info.period_samples) * sizeof(double) * info.excitation.size();
  if (period_bytes > kLargestPeriodBytes)
    fail_request(
        "log: period_samples is {}: one period of the excitation would need {} bytes; the maximum "
        "is {}",
        info.period_samples, period_bytes, kLargestPeriodBytes);
  if (info.transient_periods < 0)
    fail_request("log: transient_periods is {}; must be 0 or more", info.transient_periods);
  check_channels(info.excitation, "excitation");
  check_channels(info.actuators, "actuators");
  check_channels(info.sensors, "sensors");
  if (info.actuators.size() == 0 || info.sensors.size() == 0)
    throw std::invalid_argument("log: at least one actuator and one sensor are required");
}

bool same_measurement(const LogInfo& a, const LogInfo& b) noexcept {
  return a.sample_rate_hz == b.sample_rate_hz && a.period_samples == b.period_samples &&
         a.transient_periods == b.transient_periods && a.excitation == b.excitation &&
         a.actuators == b.actuators && a.sensors == b.sensors;
}

RunHealth& RunHealth::operator+=(const RunHealth& other) noexcept {
  cycles += other.cycles;
  late += other.late;
  missing += other.missing;
  marked += other.marked;
  irregular += other.irregular;
  lost += other.lost;
  largest_lateness_ns = std::max(largest_lateness_ns, other.largest_lateness_ns);
  seconds += other.seconds;
  return *this;
}

}  // namespace stageid
