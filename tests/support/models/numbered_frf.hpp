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
  // value(row, 1000 line)
  const auto fill = [](auto& matrix, Eigen::Index rows, auto value) {
    matrix.resize(rows, 4);
    for (Eigen::Index k = 0; k < 4; ++k)
      for (Eigen::Index c = 0; c < rows; ++c)
        matrix(c, k) = value(static_cast<double>(c), static_cast<double>(1000 * k));
  };
  using Complex = std::complex<double>;
  fill(frf.response, 6, [](double c, double line) { return Complex(line + c, -line - 10.0 * c); });
  fill(frf.noise_variance, 6, [](double c, double line) { return line + c + 0.25; });
  fill(frf.total_variance, 6, [](double c, double line) { return line + c + 0.5; });
  fill(frf.covariance, 36, [](double c, double line) { return Complex(line + c, 0.125 * c); });
  fill(frf.input_factor, 9, [](double c, double line) { return Complex(line + 2.0 * c, 0.5 * c); });
  fill(frf.residual_covariance, 4,
       [](double c, double line) { return Complex(line + c + 0.75, -line - c); });
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
