#pragma once

/// Frequency responses from closed-loop logs, their covariance and the health of the data.

#include "acquisition/formats/open_log.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "frf/response/hold_compensation.hpp"
#include "frf/response/nonlinearity.hpp"

namespace stageid {

using Frf = FrfEstimate;

/// The plant's FRF from one log, see estimate_plant_frf().
inline Frf estimate_frf(const LogReader& log, const FrfOptions& options = {}) {
  return estimate_plant_frf({&log}, options);
}

}  // namespace stageid
