#include "hal/modbus/modbus_encoding.hpp"

#include <algorithm>
#include <cmath>

#include "excitation/words/require.hpp"

namespace stageid {

bool fits_counts(double value, double si_per_count) noexcept {
  return std::abs(std::nearbyint(value / si_per_count)) <= kLargestModbusCount;  // false for NaN
}

std::int32_t to_counts(double value, double si_per_count) noexcept {
  if (std::isnan(value)) return 0;
  const double counts =
      std::clamp(std::nearbyint(value / si_per_count), -kLargestModbusCount, kLargestModbusCount);
  return static_cast<std::int32_t>(counts);
}

float count_scale(double range) {
  require(range >= 1e-20 && range <= 1e20,
          "modbus: the range of a channel must be between 1e-20 and 1e20; got {}", range);
  return static_cast<float>(std::exp2(std::ceil(std::log2(range / kLargestModbusCount))));
}

}  // namespace stageid
