#pragma once

#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/periods/start_transient.hpp"

namespace stageid {

/// Checks whether modes still ring from the start of the runs. Each resonance is tested separately, because a
/// lightly damped mode rings on a few lines only.
///
/// Test 1: W = c B with the same c in all runs, at a local maximum of the power of B over the lines (five lines; B, W
/// as in RunStart). X_r = sum B* W / |B| of run r is c |B| plus a noise of the same variance in all runs, for any colour
/// and any correlation of the sensors. So the regression over the runs gives c, and the scatter of X_r around it gives
/// an F test with one and R - 1 complex degrees of freedom. Noise with a memory longer than a period (a disturbed
/// lightly damped mode) correlates W with the noise of B, for an AR(1) process by at most 0.45 (limit of a long
/// memory). Therefore 0.6 over B's power relative to the noise is subtracted from |c|. (0.6, because B's own noise is
/// up to 1.6 times what the scatter predicts.)
///
/// Test 2, with at least three periods: the power of the first period against that of the last, both relative to the
/// periods between them. For noise, which may be reversed in time, both have the same distribution. F with one complex
/// degree of freedom per run on either side, because lines and sensors share their noise. False alarms in at most one
/// of two hundred logs (Bonferroni over maxima and tests).
///
/// A drift changes the periods along a straight line, which test 1 detects as well: alone, it has W = P/(P+1) B. Beside a
/// start that rings, W has any ratio to B, but V is 2/P of W, where a transient leaves less. The nearer of the two is
/// taken. If less than 2 % decays in a period, the finding is a drift, too.
///
/// Where test 2 finds a decay but one c explains less than half of W along B, the motion is not that of a linear
/// system: a limit cycle that comes to rest.
///
/// From W = c B follows q: c = (q - mean q^2...q^P) / (1 - mean q...q^P). The transient in the mean of the used
/// periods, relative to its noise and over all runs, sensors and lines of the window, bounds the shift of every
/// fitted parameter in its own standard deviations (Cauchy-Schwarz). The reported deviations include the scatter of the
/// periods by the transient itself: one that is gone after one used period counts as noise. Shifts below half a
/// deviation are not reported; the remedy discards as many periods as are needed to get there. Runs have random phases,
/// so the expected shift is the bound over the root of their number. It is that of the residues, along which a ringing
/// mode lies; frequency and damping shifted by about 0.45 of it (120 simulated logs with bounds from 7 to 14, and twelve
/// up to 50). A fault if that is above 1.2 deviations although the first period is discarded, at a maximum between the
/// lines.
std::vector<Finding> check_start_transient(const StartEvidence& evidence);

}  // namespace stageid
