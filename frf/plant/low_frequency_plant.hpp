#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A plant below the lines of its response, where a free body on its way to flexible modes is
///   G(s) = (B / s^2 + D + E s^2) exp(-s tau),
/// tau of the transport and half a sample of hold. B, D and E are fitted, entry by entry, to the lowest
/// lines: those up to 0.7 of the frequency where omega^2 |G| has grown by half over its median, each
/// held to its noise and to 2 % of its row. B is then reduced to what a rigid body can be: its columns and
/// rows are combinations of the six motions as the channels' positions and directions show them.
class LowFrequencyPlant {
 public:
  /// @param delay_s  tau
  /// @param output_motions, input_motions  channels x 6: each channel's part of the six rigid motions
  LowFrequencyPlant(const FrfEstimate& frf, double delay_s, const Eigen::MatrixXd& output_motions,
                    const Eigen::MatrixXd& input_motions);

  /// Channels as frf.response has them. @pre frequency_hz > 0
  Eigen::VectorXcd response(double frequency_hz) const;

  /// What the fit leaves of its lines, rms of |error| / |G|.
  double misfit() const { return misfit_; }

 private:
  double delay_s_ = 0.0;
  double scale_rad_s_ = 1.0;
  Eigen::MatrixXd terms_;  // of 1 / x, 1, x with x = -(omega / scale)^2: 3 x channels
  double misfit_ = 0.0;
};

}  // namespace stageid
