#pragma once

#include <Eigen/Core>
#include <optional>

#include "frf/periods/mode_drift.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// How the response changes in time, summed up realization by realization: the slope over the periods within the
/// runs and the slope over the realizations.
///
/// Where a mode's frequency moves by the share d, G changes by X d, X = -f dG/df. In windows of nine lines d is
/// fitted to the slope by weighted least squares, once to that within the runs, once to that over the realizations.
/// Noise of S kron C_E gives its deviation. A drift is reported if d is 8 deviations off zero (Student's t with 36
/// degrees of freedom, the fewest: 2e-9), if X d is more than half, over realizations 0.8, of what the slope has beyond noise (a
/// transient or distortions have phases of their own on every line), and if half of the whole change exceeds a deviation of the response.
class ResponseDrift {
 public:
  ResponseDrift(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines);

  /// Line k of realization number `count` from 0, of those that are used. Different lines at once.
  void add(const RealizationSpectra& spectra, const LineEstimate& line, int count, Eigen::Index k);

  /// @param frf          finished, on the same lines
  /// @param G_mean       mean of the realizations' responses
  /// @param run_periods  periods of a run, transient ones too
  std::optional<ModeDrift> find(const FrfEstimate& frf, const Eigen::MatrixXcd& G_mean,
                                int run_periods) const;

 private:
  Eigen::Index outputs_;
  Eigen::MatrixXcd slope_sum_;    // vec(dG / period) x lines
  Eigen::MatrixXcd counted_sum_;  // sum of count vec(G)
  Eigen::VectorXd variance_sum_;  // of the slope over that of a realization's G, by line
};

}  // namespace stageid
