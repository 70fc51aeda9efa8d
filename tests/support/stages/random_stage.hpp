#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "estimation/model/additive_model.hpp"
#include "frf/response/frf_estimate.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {

/// What kind of stages to draw.
struct RandomStageSpec {
  int outputs = 4;
  int inputs = 13;
  int least_modes = 5;
  int most_modes = 25;
  int most_missing_peaks = 3;  ///< of the CMIF, taken away from a blind fit's start on purpose
  int most_pairs = 3;          ///< of modes closer than twice their half-power width
  double least_damping = 0.002;
  double most_damping = 0.02;
  double least_noise_db = -70.0;
  double most_noise_db = -30.0;
  double first_mode_hz = 80.0;
  double last_mode_hz = 1900.0;
  double band_low_hz = 20.25;  ///< lines of the paper: odd multiples of 0.25 Hz
  double band_high_hz = 2000.0;
  double line_spacing_hz = 0.5;
  double sample_rate_hz = 10000.0;
};

/// A stage as drawn: rigid body of rank 3 and modes of rank one behind a hold and a delay.
struct RandomStage {
  AdditiveModel truth;
  std::uint64_t seed = 0;
  int pairs = 0;
  int missing_peaks = 0;
  double noise_db = 0.0;  ///< standard deviation over the median magnitude, channel by channel
  int noise_slope = 0;    ///< the noise falls as omega^-slope
  double delay_s = 0.0;
  Eigen::MatrixXcd exact;    ///< n_c x N
  Eigen::MatrixXd variance;  ///< n_c x N, what the noise was drawn with
  FrfEstimate frf;           ///< exact + noise; noise_variance from 52 degrees of freedom
  std::string description() const;
};

RandomStage draw_random_stage(std::uint64_t seed, const RandomStageSpec& spec = {});

}  // namespace stageid::test
