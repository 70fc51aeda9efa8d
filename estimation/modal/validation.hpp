#pragma once

#include "estimation/modal/residual_verdict.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// How a model does on a response that it was not fitted to.
struct Validation {
  /// sqrt(mean |E|^2/|G|^2) over the lines of the channels that respond, see responding_channels(); NaN:
  /// none does.
  double relative_rms_error = 0.0;
  double normalized_error = 0.0;    ///< sum |E|^2 over sum |G|^2, square root; NaN: G is zero
  double chi_square_per_dof = 0.0;  ///< mean |E|^2/variance; 0: unknown
  /// What that is if the error is noise: nu / (nu - 1), the mean of F(2, 2 nu), for a variance of nu degrees
  /// of freedom; 1 for an exact one, 0 without a mean.
  double expected_chi_square = 0.0;
  ResidualVariance variance = ResidualVariance::none;  ///< what the figures compare with
  bool explained = true;  ///< see judge_residual(); true also where the data have no variances
  std::string reason;     ///< why the error is not explained, one sentence; empty if it is
  double whitened_above_95 =
      0.0;  ///< share of |e|^2 above the 95 % point of noise alone; 0.05 is right
  double whiteness =
      0.0;  ///< largest |autocorrelation| of the whitened residual over lines, lags 1..10,
  double whiteness_limit = 0.0;  ///<   and its 99 % limit
  Eigen::VectorXd
      channel_error;  ///< relative rms error per channel, n_y n_u; NaN: it does not respond
};

/// Compares a model with measured data on their lines, through the hold and delay that the data
/// still hold, see judge_residual() for the verdict.
/// @throws std::invalid_argument if channels do not match by name, or have other units (unknown ones match all).
/// @param known distortion that the fit of the model has seen, see judge_residual()
Validation validate(const AdditiveModel& model, const FrfEstimate& frf,
                    const Distortion& known = {});

/// The model's response as it would have been measured: through hold and delay unless the data are
/// compensated.
Eigen::MatrixXcd response_like(const AdditiveModel& model, const FrfEstimate& frf);

}  // namespace stageid
