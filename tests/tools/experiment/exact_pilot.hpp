#pragma once

#include "frf/response/frf_estimate.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "tests/support/logs/faulty_log.hpp"

namespace stageid::test {

/// The exact response of the stage, as a pilot of it without noise.
inline FrfEstimate exact_pilot(const WaferStageSpec& stage, const Eigen::VectorXd& frequency_hz) {
  FrfEstimate frf;
  frf.frequency_hz = frequency_hz;
  frf.sample_rate_hz = stage.info.sample_rate_hz;
  frf.hold = Hold::zoh;
  frf.inputs = list_of(stage.info.actuators);
  frf.outputs = list_of(stage.info.sensors);
  const std::vector<PlantMode> modes = wafer_stage_modes(stage);
  frf.response.resize(frf.n_outputs() * frf.n_inputs(), frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    frf.response.col(k) =
        sampled_response(modes, stage.info.delay_s, stage.info.sample_rate_hz, frf.frequency_hz[k])
            .reshaped();
  return frf;
}

}  // namespace stageid::test
