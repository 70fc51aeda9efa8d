#pragma once

#include <vector>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A pole of one order of a stabilization diagram, compared with the nearest one of the previous order.
struct StabilizationPole {
  int order = 0;  ///< of the denominator
  double frequency_hz = 0.0;
  double damping_ratio = 0.0;
  bool stable_frequency = false;
  bool stable_damping = false;  ///< implies stable_frequency
};

struct StabilizationOptions {
  int most_order = 80;   ///< even orders from 2 on
  double delay_s = 0.0;  ///< removed from the response first, including that of the hold
};

/// Poles over orders by the least-squares complex frequency domain method, with one denominator for all channels:
/// in z = e^{j omega T}, T = 1 / (2 f_N), minimise
///   sum_kc w_kc^2 |N_c(z_k^-1) - H_c(k) D(z_k^-1)|^2,   D = d_0 + ... + d_{n-1} z^-(n-1) + z^-n,
/// with w_kc = omega_k^2 over the rms of omega^2 H_c. On real coefficients the normal equations are Toeplitz in the
/// powers, so all orders are computed from one pass over the lines; every D is a leading block of the largest. The
/// numerators have the largest order throughout. Fixing the last coefficient places the poles that only fit the
/// noise outside the unit circle, where they are dropped; those of the plant remain (Cauberghe et al.).
///
/// An independent check of the modes of a fit, not a start for one: damping is biased if noise is large, as in every
/// linear least squares.
/// @return by order, then by frequency; only decaying poles within the lines, with a damping ratio of at most 0.2
/// @throws std::invalid_argument if most_order < 2, or 2 most_order >= the number of lines.
/// Source: P. Guillaume et al., Proc. 21st IMAC (2003) 183; B. Cauberghe et al., Mech. Syst. Signal Process. 19
/// (2005) 1080.
std::vector<StabilizationPole> stabilization(const FrfEstimate& frf,
                                             const StabilizationOptions& options = {});

}  // namespace stageid
