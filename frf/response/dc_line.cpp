#include "frf/response/dc_line.hpp"

#include <stdexcept>
#include <utility>

namespace stageid {

bool has_dc_line(const FrfEstimate& frf) { return frf.lines() > 0 && frf.frequency_hz[0] == 0.0; }

FrfEstimate without_dc_line(FrfEstimate frf) {
  if (!has_dc_line(frf)) return frf;
  if (frf.lines() == 1)
    throw std::invalid_argument(
        "the only line is at 0 Hz, which `fit` and `modes` ignore; use a wider --band");
  const double low_hz = frf.frequency_hz[1];
  const double high_hz = frf.frequency_hz[frf.lines() - 1];
  return select_band(std::move(frf), low_hz, high_hz);
}

}  // namespace stageid
