#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "frf/periods/health_finding.hpp"

namespace stageid {

/// A change of a channel is larger than this, and explains at least this share of a misfit. Smaller ones are noise, or
/// do no harm.
inline constexpr double kChangeDeviations = 6.0;
inline constexpr double kLeastGainChange = 0.02;
inline constexpr double kLeastSkewChange_s = 2e-6;
inline constexpr double kLeastChangeShare = 0.3;

inline constexpr double kMicroseconds = 1e6;

/// What one realization has different from the others: one channel of its response, two, or all.
struct RealizationChange {
  enum class Kind : std::uint8_t { gain, skew, swap };
  Kind kind = Kind::gain;
  int realization = 0;  ///< counted from 0
  int other = -1;       ///< the only other one, if there are two: either may be wrong
  std::string channel;  ///< "s2", "a1 a3", or "all sensors"
  double value = 1.0;   ///< factor or delay in s, relative to the other realizations
  double deviation = 0.0;
};
Finding to_finding(const RealizationChange& change);

/// "1.05 +- 0.002"; without a deviation the value with this number of digits.
std::string with_deviation(double value, double deviation, int digits);

/// The plant differs between realizations, in a way that no channel explains.
struct PlantChange {
  double low_hz = 0.0;  ///< of the band with the clearest difference
  double high_hz = 0.0;
  double p_value = 1.0;  ///< of differences so alike on neighbouring lines, over all tests
  double ratio = 0.0;    ///< scatter of the realizations in this band over that of noise
  std::vector<int> realizations{};  ///< counted from 0: those that differ from the others, if known
};

/// Differences between the realizations of a log.
struct RealizationDifferences {
  std::vector<RealizationChange> changes;  ///< by realization, then by what they explain
  std::optional<PlantChange> plant;
  /// Counted from 0: much farther from the others than these from each other; of two, the second one.
  std::vector<int> outlying;
};

/// A fault if the difference misleads, a doubt otherwise.
Finding to_finding(const PlantChange& change);

}  // namespace stageid
