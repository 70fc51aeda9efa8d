#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/periods/start_transient.hpp"

namespace stageid {

/// Does a mode still ring from the start of the runs? Resonance by resonance, since one lightly damped mode
/// rings on a few lines only.
///
/// Where the start rings most (a local maximum over the lines of the power of B, five lines),
/// X = sum B* W of each run has any phase if W is noise, whatever its colour and however the sensors
/// share it. Over the runs the phases are then uniform, and of the resultant R with weights m, which are of B
/// alone, P(R^2 > t sum m^2) <= e^-t (Rayleigh's test). Noise with a memory longer than a period, as of a
/// lightly damped mode that is shaken, correlates W with the noise of B: by 0.45 of an AR(1) process at most
/// (in the limit of a long memory), so that 0.6 over the root of B's power over the noise is taken off R / sum m
/// (0.6: B's own noise is up to 1.6 times what the scatter says). With three periods and more the power of W is
/// also held against that of V, the last period against those before it, which noise cannot tell from W
/// with time reversed: F with one complex degree of freedom a run on either side, for lines and sensors share
/// their noise. A finding by chance in at most one of two hundred logs (Bonferroni over maxima and tests).
///
/// A multiple c of B that W is gives q: c = (q - mean q^2...q^P) / (1 - mean q...q^P). What the mean of
/// the used periods holds of it, over its noise and over all runs, sensors and lines of the window, bounds
/// the shift of every parameter that is fitted there, in its own standard deviations (Cauchy-Schwarz);
/// below half a deviation nothing is said, and the remedy passes over as many periods as bring it there.
std::vector<Finding> check_start_transient(const StartEvidence& evidence);

}  // namespace stageid
