#pragma once

#include <Eigen/Core>

#include "estimation/modal/state_space.hpp"

namespace stageid {

/// A model as sampled by a digital loop. Whole samples of delay are separate from the system:
///
///   x[n+1] = A x[n] + sum_j B_j u_j[n - input_delay_samples_j]
///   y_i[n + output_delay_samples_i] = C_i x[n] + sum_j D_ij u_j[n - input_delay_samples_j]
///
/// output_delay_samples is not negative; input_delay_samples is negative only if the delays of the model are.
struct SampledStateSpace {
  StateSpace system;  ///< block diagonal; the poles are those of the z plane
  double sample_rate_hz = 0.0;
  Eigen::VectorX<long long> input_delay_samples;   ///< n_u
  Eigen::VectorX<long long> output_delay_samples;  ///< n_y
};

/// The sampled model behind a zero-order hold, with its delays. Exact at the sampling instants, including
/// fractions of a sample, as response() with HoldModel::exact.
///
/// A delay of less than a sample only moves the instants within the hold at which states and outputs
/// are evaluated. Let F_ij T in (-T, T) be the delay of a channel without whole samples, F_ij = a_i + b_j,
/// Gamma(t) = integral of e^{A v} over [0, t], and h[n] the response to a held sample:
///   F <= 0:  h[0] = C_i Gamma(-F T) B_j,  h[n] = C_i e^{-A a_i T} e^{A T (n-1)} e^{-A b_j T} Gamma(T) B_j
///   F > 0:   h[0] = 0, h[1] = C_i Gamma((1 - F) T) B_j, from n = 2 on as above
/// so the order is that of state_space() unless a channel has F > 0. The whole samples are divided
/// between inputs and outputs such that the fewest have F > 0. The remaining difference of h[1] is represented
/// by delay states (pole 0, submodel -1), as many as the rank of that matrix. One delay for all channels,
/// for all outputs, or for all inputs needs none.
/// Minimal as state_space(), unless sampling makes poles coincide.
/// Source: K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed. (1997), sections 2.3
/// and 2.4.
///
/// @throws std::invalid_argument as state_space(), and if the model has no sample rate.
SampledStateSpace sampled_state_space(const AdditiveModel& model);

}  // namespace stageid
