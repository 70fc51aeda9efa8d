#pragma once

#include <Eigen/Core>
#include <complex>

#include "frf/response/frf_estimate.hpp"

namespace stageid::test {

/// An FRF with 2 outputs, 3 inputs, 4 lines, everything present, every number different.
inline FrfEstimate numbered_frf() {
  FrfEstimate frf;
  frf.frequency_hz = Eigen::VectorXd{{1.0, 2.5, 3.0, 10.0}};
  frf.inputs = {{"a1", "a2", "a3"}, {"N", "N", "Nm"}};
  frf.outputs = {{"z1", "z2"}, {"m", "m"}};
  frf.response.resize(6, 4);
  frf.covariance.resize(36, 4);
  frf.input_factor.resize(9, 4);
  frf.noise_variance.resize(6, 4);
  frf.total_variance.resize(6, 4);
  frf.residual_covariance_re.resize(4, 4);
  frf.residual_covariance_im.resize(4, 4);
  for (Eigen::Index k = 0; k < 4; ++k) {
    const auto line = static_cast<double>(1000 * k);
    for (Eigen::Index c = 0; c < 6; ++c) {
      const auto channel = static_cast<double>(c);
      frf.response(c, k) = {line + channel, -line - 10.0 * channel};
      frf.noise_variance(c, k) = line + channel + 0.25;
      frf.total_variance(c, k) = line + channel + 0.5;
    }
    for (Eigen::Index c = 0; c < 36; ++c) {
      frf.covariance(c, k) = {line + static_cast<double>(c), 0.125 * static_cast<double>(c)};
    }
    for (Eigen::Index c = 0; c < 9; ++c) {
      frf.input_factor(c, k) = {line + 2.0 * static_cast<double>(c), 0.5 * static_cast<double>(c)};
    }
    for (Eigen::Index c = 0; c < 4; ++c) {
      frf.residual_covariance_re(c, k) = line + static_cast<double>(c) + 0.75;
      frf.residual_covariance_im(c, k) = -line - static_cast<double>(c);
    }
  }
  frf.input_condition = Eigen::VectorXd{{1.0, 2.0, 3.0, 4.0}};
  frf.sample_rate_hz = 100.0;
  frf.hold = Hold::zoh;
  frf.compensated = Compensation::delay;
  frf.delay_s = 1.5e-3;
  frf.realizations = 3;
  frf.periods = 5;
  frf.experiments = 7;
  frf.noise_dof = 84.0;
  frf.total_dof = 2.0;
  frf.excluded_channels = {"x1", "y1"};
  frf.excluded_power = Eigen::VectorXd{{1e-3, 2e-3}};
  frf.provenance_json = R"({"inputs":[]})";
  return frf;
}

}  // namespace stageid::test
