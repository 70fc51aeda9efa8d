#pragma once

#include <optional>
#include <vector>

#include "estimation/loop/loop_transfer.hpp"

namespace stageid {

/// One margin of a loop, where it is reached.
struct Margin {
  double value = 0.0;
  double frequency_hz = 0.0;
  /// To first order, from the covariance of the parameters; none: unknown.
  std::optional<double> deviation = {};
  std::optional<double> frequency_deviation_hz = {};  ///< of a crossing
  /// Outside the band of the fit, where the covariance does not include what the model lacks.
  bool extrapolated = false;

  /// The interval that contains the true value with probability 0.95: value -+ this.
  std::optional<double> radius_95() const;
};

/// The margins of a loop L, opened alone, with the others closed. Absent ones are infinite.
struct LoopMargins {
  std::optional<Margin> gain_db;            ///< the gain may rise by this; L crosses (-1, 0)
  std::optional<Margin> gain_reduction_db;  ///< the gain may fall by this; L crosses below -1
  std::optional<Margin> phase_deg;          ///< the smallest angle between L and -1 where |L| = 1
  std::optional<Margin> delay_s;            ///< the smallest delay that turns L to -1
  Margin modulus;  ///< min |1 + L|, the reciprocal of the largest sensitivity
};

/// The margins of all loops, and the least distance of det(I + L) from zero.
struct MarginSet {
  std::vector<LoopMargins> loops;
  Margin distance;  ///< min |det(I + L)|
};

/// Searches the margins up to half the sample rate, on a logarithmic grid that is refined around the modes of the model;
/// then refines every crossing. With the gradient g = dL / d parameters and L' = dL / d omega at a crossing, and ln g_m
/// the logarithm of the gain margin:
///   d ln g_m = -(Re g - Re L' / Im L' Im g) / Re L,
///   d phase  = Im(g / L) - Im(L' / L) / Re(L' / L) Re(g / L),
///   d |1 + L| = Re(conj(1 + L) g) / |1 + L|,
/// and the variance of each is that of a linear function of the parameters (docs/theory.md, section 15).
/// @param covariance of all parameters, FitCovariance::sandwich; 0 x 0: unknown
/// @throws std::invalid_argument as loop_points() and ResponseGradient
MarginSet loop_margins(const AdditiveModel& model, const LoopController& controller,
                       const Eigen::MatrixXd& covariance);

}  // namespace stageid
