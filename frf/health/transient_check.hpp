#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/periods/start_transient.hpp"

namespace stageid {

/// Checks whether modes still ring from the start of the runs. Each resonance is tested separately, because a
/// lightly damped mode rings on a few lines only.
///
/// Test 1: the phase of X = sum B* W of each run, at a local maximum of the power of B over the lines (five
/// lines; B, W as in RunStart). If W is noise, the phases are uniform over the runs, for any colour and any
/// correlation of the sensors. Then the resultant R with weights m, which depend on B only, satisfies
/// P(R^2 > t sum m^2) <= e^-t (Rayleigh's test). Noise with a memory longer than a period (a disturbed lightly
/// damped mode) correlates W with the noise of B, for an AR(1) process by at most 0.45 (limit of a long memory).
/// Therefore 0.6 over the root of B's power over the noise is subtracted from R / sum m. (0.6, because
/// B's own noise is up to 1.6 times what the scatter predicts.)
///
/// Test 2, with at least three periods: the power of the first period against that of the last, both relative to the
/// periods between them. For noise, which may be reversed in time, both have the same distribution. F with one complex
/// degree of freedom per run on either side, because lines and sensors share their noise. False alarms in at most one
/// of two hundred logs (Bonferroni over maxima and tests).
///
/// A drift changes the periods along a straight line, which test 1 detects as well. The phase of the curvature K
/// relative to the slope L (RunStart) is the same in all runs for a transient and random for a drift. If neither it
/// nor test 2 shows a decay, or if less than 2 % decays in a period, the finding is a drift.
///
/// Where test 2 finds a decay but the phases of the runs do not agree, the motion is not that of a linear system: a limit
/// cycle that comes to rest.
///
/// From W = c B follows q: c = (q - mean q^2...q^P) / (1 - mean q...q^P). The transient in the mean of the used
/// periods, relative to its noise and over all runs, sensors and lines of the window, bounds the shift of every
/// fitted parameter in its own standard deviations (Cauchy-Schwarz). Shifts below half a deviation are not
/// reported; the remedy discards as many periods as are needed to get there. Runs have random phases, so the
/// expected shift is the bound over the root of their number. A fault if it is above three deviations although the
/// first period is discarded, at a maximum between the lines.
std::vector<Finding> check_start_transient(const StartEvidence& evidence);

}  // namespace stageid
