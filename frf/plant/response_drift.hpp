#pragma once

#include <Eigen/Core>
#include <optional>

#include "frf/periods/estimate_results.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// Change of the response in time, accumulated over realizations: the slope over the periods within the runs and the
/// slope over the realizations (docs/theory.md, section 13).
///
/// If a mode's frequency changes by the share d, G changes by X d, X = -f dG/df. A resonance narrower than a few lines
/// has no such differences; over the realizations, X may also follow from a pole that the channels have in common. In
/// windows of nine lines, d is fitted by weighted least squares to the slope within the runs, and to that over the
/// realizations, with the X that explains more. Noise of S kron C_E gives its standard deviation, enlarged by what X d leaves unexplained. A drift is
/// reported on three conditions:
///   - d is 8 standard deviations from zero (Student's t with at least 36 degrees of freedom: 2e-9).
///   - X d is more than half (over realizations 0.8) of the slope beyond noise. A transient or distortions have other
///     phases on every line.
///   - Half of the whole change exceeds one standard deviation of the response.
class ResponseDrift {
 public:
  ResponseDrift(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines);

  /// Adds line k of realization number `count`, from 0, of the used ones. Different lines may be added concurrently.
  void add(const RealizationSpectra& spectra, const LineEstimate& line, int count, Eigen::Index k);

  /// @param frf          finished, on the same lines
  /// @param G_mean       mean of the realizations' responses
  /// @param run_periods  periods per run, including transient ones
  std::optional<ModeDrift> find(const FrfEstimate& frf, const Eigen::MatrixXcd& G_mean,
                                int run_periods) const;

 private:
  Eigen::Index outputs_;
  Eigen::MatrixXcd slope_sum_;    // vec(dG / period) x lines
  Eigen::MatrixXcd counted_sum_;  // sum of count vec(G)
  Eigen::VectorXd variance_sum_;  // of the slope over that of a realization's G, by line
};

}  // namespace stageid
