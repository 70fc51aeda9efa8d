#pragma once

#include "frf/response/frf_estimate.hpp"
#include "tests/support/logs/faulty_log.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid::test {

/// The exact response of the stage, as a pilot of it without noise.
inline FrfEstimate exact_pilot(const StageConfig& config, const Eigen::VectorXd& frequency_hz) {
  const StageInfo& info = config.spec.info;
  FrfEstimate frf;
  frf.frequency_hz = frequency_hz;
  frf.sample_rate_hz = info.sample_rate_hz;
  frf.hold = Hold::zoh;
  frf.inputs = list_of(info.actuators);
  frf.outputs = list_of(info.sensors);
  const std::vector<PlantMode> modes = plant_modes(info, config.plant.value());
  frf.response.resize(frf.n_outputs() * frf.n_inputs(), frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    frf.response.col(k) =
        sampled_response(modes, info.delay_s, info.sample_rate_hz, frf.frequency_hz[k]).reshaped();
  return frf;
}

}  // namespace stageid::test
