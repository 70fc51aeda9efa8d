#pragma once

#include <vector>

#include "frf/periods/actuator_step.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/frf_options.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {

/// Finds actuators that apply their recorded commands u in steps, or up to a limit.
///
/// The error of a converter is a function of u, and periodic in u with the step. It is part of the residual
/// E = Y - G U, here on excited and detection lines. Matched to the response of actuator j and back in time,
///   d_j(t) = DFT^-1( sum_i conj(G_ij) E_i / var E_i ),
/// it is therefore collected by the command of its sample: H_j(u) = sum of d_j(t) over the samples with u_j(t) = u. The
/// spectrum of H_j over the powers of the samples is exponentially distributed without steps. With steps, it has a peak
/// at one period per step. Actuators of one unit are tested together, because they often have the same converter: the
/// sum of their spectra has a gamma distribution. Only experiments that excite an actuator are used for it, and at most
/// four periods of each run. Steps below 1/4096 of the largest command are not found.
///
/// A limit of the applied command makes a function of u without a period. It is taken where it explains more of H_j than
/// steps, and found within a few percent. So may a smooth nonlinearity of the plant: the caller compares the scatter of
/// the realizations.
///
/// Steps of an earlier estimate of the runs are applied, and looked for in the actuators without one.
///
/// @param frf the response of these runs; its channels are tested
/// @returns the others; by chance, a wrong one in less than one of 1e8 logs
/// @throws the same as LogReader::read()
std::vector<ActuatorStep> find_actuator_steps(const std::vector<RealizationRuns>& realizations,
                                              const FrfEstimate& frf, const FrfOptions& options);

}  // namespace stageid
