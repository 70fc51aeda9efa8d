#pragma once

#include <Eigen/Core>
#include <optional>

#include "acquisition/record/log_reader.hpp"
#include "excitation/multisine/dft.hpp"

namespace stageid {

/// Where one of two periods, recorded one after the other, stops following the other.
struct PeriodSlip {
  Eigen::Index row = 0;  ///< within its period: the first row behind the gap
  int lost = 0;          ///< samples; < 0: so many too many
  bool in_earlier =
      false;            ///< the gap is in the earlier period, the later one is displaced throughout
  bool sensors = true;  ///< which channels
  bool actuators = true;
};

/// Finds a sample that was lost, or written twice, in one of two periods of a periodic signal.
///
/// Behind a gap of d samples a record shows what it showed d samples earlier, x[n] = x'[(n + d) mod N]. With the
/// differences e of `later` to `earlier` shifted by 0 and by d, both over their smallest scatter, the place of the gap is
/// where the sum of e_0^2 - e_d^2 up to it, or from it on, is largest. It counts if there mean e_0^2 is more than
/// 1.5 times mean e_d^2 and more than 8 deviations of noise of that spectrum beyond it (1e-15 by chance): without a gap the shift can
/// only add to the difference, and what is not periodic (a glitch, a transient) is in both. Sensors and actuators may
/// come from different recorders: all, or those of one kind, are looked at, and one kind alone counts from 10 times on,
/// since a slow transient may happen to look like a shift of slow signals by half. More than 4 samples count from 10
/// times on in both kinds, and inside a period. Few samples at the edge of a period, 1600
/// over the channels, are not enough; the next period shows them.
///
/// d is any of -4 ... 4, or one of the three largest peaks of the periods' cross-correlation.
/// @pre both have `dft.length()` rows
std::optional<PeriodSlip> find_slip(const LogSamples& earlier, const LogSamples& later,
                                    RealDft& dft);

}  // namespace stageid
