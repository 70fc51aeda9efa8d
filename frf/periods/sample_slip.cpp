#include "frf/periods/sample_slip.hpp"

#include <fmt/format.h>

#include <cstdlib>

#include "acquisition/files/counted.hpp"

namespace stageid {
namespace {

/// "one sample of s2"
std::string samples_of(const SampleSlip& slip) {
  const int count = std::abs(slip.lost);
  std::string samples = count == 1 ? "one sample" : counted(count, "sample");
  if (!slip.channel.empty()) return fmt::format("{} of {}", samples, slip.channel);
  if (slip.sensors && slip.actuators) return samples;
  return fmt::format("{} of all {}", samples, slip.sensors ? "sensors" : "actuators");
}

}  // namespace

std::string to_string(const SampleSlip& slip) {
  return fmt::format("{} {} near row {}", samples_of(slip), slip.lost > 0 ? "lost" : "too many",
                     slip.row);
}

Finding to_finding(const SampleSlip& slip) {
  return {Severity::doubt,
          Cause::lost_samples,
          "",
          fmt::format("{} {} in run {} near row {}", samples_of(slip),
                      slip.lost > 0 ? "lost" : "too many", slip.run, slip.row),
          fmt::format("realization {}, experiment {}", slip.realization + 1, slip.experiment + 1),
          slip.spoilt
              ? "its period is discarded and the later ones are realigned; check the recorder"
              : "the later periods are realigned; check the recorder"};
}

}  // namespace stageid
