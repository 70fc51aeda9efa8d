#pragma once

#include "frf/response/frf_estimate.hpp"
#include "frf/response/nonlinearity.hpp"

namespace stageid {

/// Lowers the noise variances of `frf` to what the realizations show, where the periods overstate them.
///
/// Periods of a run follow one another. Slow motion that does not repeat leaks into all lines of a period with the
/// difference of its two ends; the next period begins where this one ends, so most of it cancels in their mean:
///   sum_p T_p = T(last end) - T(first start).
/// The scatter of the periods contains all of it. Setpoints, limit cycles of coarse commands, and noise with narrow
/// resonances overstate the variance of the mean by 2 to 30 in this way. Realizations have no common ends.
/// On a linear plant F = total / noise of `scatter` has the distribution F(2 (M - 1), 2 nu) and the mean nu / (nu - 1).
/// In each octave, or more if it has few lines, and for each output, the mean over lines and inputs is compared with
/// it. Where it is smaller, by chance in one of a hundred estimates of all outputs and octaves, the variances are
/// multiplied by its ratio to the expected one. Larger scatter is distortion or a transient, and tested as such.
/// Source: docs/theory.md, section 3 (noise that leaks).
/// @param scatter  of the realizations; nothing is done if it is empty
void lower_leaked_noise(const RealizationScatter& scatter, FrfEstimate& frf);

}  // namespace stageid
