#pragma once

#include <Eigen/Core>

#include "estimation/modal/state_space.hpp"

namespace stageid {

/// A model as a digital loop sees it. Whole samples of delay stand beside the system:
///
///   x[n+1] = A x[n] + sum_j B_j u_j[n - input_delay_samples_j]
///   y_i[n + output_delay_samples_i] = C_i x[n] + sum_j D_ij u_j[n - input_delay_samples_j]
///
/// output_delay_samples is not negative; input_delay_samples only if the model's delays are.
struct SampledStateSpace {
  StateSpace system;  ///< block diagonal; the poles are those of the z plane
  double sample_rate_hz = 0.0;
  Eigen::VectorX<long long> input_delay_samples;   ///< n_u
  Eigen::VectorX<long long> output_delay_samples;  ///< n_y
};

/// The model behind a zero-order hold, with its delays, sampled: exact at the sampling instants,
/// fractions of a sample included, as response() with HoldModel::exact.
///
/// A delay of less than a sample only moves the instants within the hold at which states and outputs
/// are evaluated. With the delay of a channel, whole samples taken off, F_ij T in (-T, T),
/// Gamma(t) = integral of e^{A v} over [0, t], F_ij = a_i + b_j, and the response h[n] to a held sample:
///   F <= 0:  h[0] = C_i Gamma(-F T) B_j,  h[n] = C_i e^{-A a_i T} e^{A T (n-1)} e^{-A b_j T} Gamma(T) B_j
///   F > 0:   h[0] = 0, h[1] = C_i Gamma((1 - F) T) B_j, from n = 2 on as above
/// so the order is that of state_space() unless a channel has F > 0. The whole samples are divided
/// between inputs and outputs such that the fewest have; what h[1] then differs by goes into states
/// that are delays (pole 0, submodel -1), as many as that matrix has ranks. One delay for all channels,
/// or for all outputs, or for all inputs, needs none.
/// Minimal as state_space(), unless sampling makes poles coincide.
/// Source: K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed. (1997), sections 2.3
/// and 2.4.
///
/// @throws std::invalid_argument as state_space(), and if the model has no sample rate.
SampledStateSpace sampled_state_space(const AdditiveModel& model);

}  // namespace stageid
