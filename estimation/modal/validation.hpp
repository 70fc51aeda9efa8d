#pragma once

#include "estimation/modal/residual_verdict.hpp"
#include "estimation/model/additive_model.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Errors of a model on a response that it was not fitted to.
struct Validation {
  /// sqrt(mean |E|^2/|G|^2) over the lines of the responding channels, see responding_channels(); NaN if there are
  /// none.
  double relative_rms_error = 0.0;
  double normalized_error = 0.0;    ///< sqrt(sum |E|^2 / sum |G|^2); NaN: G is zero
  double chi_square_per_dof = 0.0;  ///< mean |E|^2/variance; 0: unknown
  /// Its expectation if the error is noise: nu / (nu - 1), the mean of F(2, 2 nu), for a variance of nu degrees of
  /// freedom; 1 for an exact one; 0 if infinite.
  double expected_chi_square = 0.0;
  ResidualVariance variance = ResidualVariance::none;  ///< the variance used for the figures
  /// See judge_residual(); true also if nothing can be compared. False if the model is worse than none.
  bool explained = true;
  std::string reason;  ///< why the error is not explained, one sentence; else empty
  double whitened_above_95 =
      0.0;  ///< share of |e|^2 above the 95 % point of noise alone; 0.05 is expected
  double whiteness =
      0.0;  ///< largest |autocorrelation| of the whitened residual over lines, lags 1..10,
  double whiteness_limit = 0.0;  ///<   and its 99 % limit
  Eigen::VectorXd
      channel_error;  ///< relative rms error per channel, n_y n_u; NaN: does not respond
};

/// Compares a model with measured data on their lines, through the hold and delay that the data still contain; see
/// judge_residual() for the verdict.
/// @throws std::invalid_argument if channel names differ, or units differ (unknown ones match all).
/// @param known distortion, from the fit of the model, see judge_residual()
Validation validate(const AdditiveModel& model, const FrfEstimate& frf,
                    const Distortion& known = {});

/// The response of the model as it would have been measured: through hold and delay unless the data are compensated.
Eigen::MatrixXcd response_like(const AdditiveModel& model, const FrfEstimate& frf);

}  // namespace stageid
