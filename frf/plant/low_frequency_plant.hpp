#pragma once

#include <Eigen/Core>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A plant below the lines of its response. From a free body to flexible modes it is
///   G(s) = (B / s^2 + D + E s^2) exp(-s tau),
/// with tau the transport delay plus half a sample of hold. B, D and E are fitted per entry to the lines up to 0.7 of
/// the frequency at which omega^2 |G| exceeds its median by half. Each line is weighted by its noise and by 2 % of its
/// row. B is then projected onto the possible motions of a rigid body: its columns and rows are combinations of the
/// six motions at the positions and directions of the channels.
class LowFrequencyPlant {
 public:
  /// @param delay_s  tau
  /// @param output_motions, input_motions  channels x 6: each channel's part of the six rigid motions
  LowFrequencyPlant(const FrfEstimate& frf, double delay_s, const Eigen::MatrixXd& output_motions,
                    const Eigen::MatrixXd& input_motions);

  /// Channels as in frf.response. @pre frequency_hz > 0
  Eigen::VectorXcd response(double frequency_hz) const;

  /// Residual of the fit on its lines, rms of |error| / |G|.
  double misfit() const { return misfit_; }

 private:
  double delay_s_ = 0.0;
  double scale_rad_s_ = 1.0;
  Eigen::MatrixXd terms_;  // of 1 / x, 1, x with x = -(omega / scale)^2: 3 x channels
  double misfit_ = 0.0;
};

}  // namespace stageid
