#pragma once

#include <Eigen/Core>
#include <optional>

#include "acquisition/record/log_reader.hpp"
#include "excitation/multisine/dft.hpp"

namespace stageid {

/// Position of a gap between two consecutive periods.
struct PeriodSlip {
  Eigen::Index row = 0;  ///< first row after the gap, within its period
  int lost = 0;          ///< samples; < 0: duplicated
  bool in_earlier =
      false;            ///< the gap is in the earlier period, and the whole later one is displaced
  bool sensors = true;  ///< affected channels
  bool actuators = true;
  Eigen::Index channel = -1;  ///< the only affected one of its kind; -1: all of them
};

/// Finds lost or duplicated samples in one of two periods of a periodic signal (docs/theory.md, section 13).
///
/// After a gap of d samples, the record is x[n] = x'[(n + d) mod N]. Let e_d be the difference of `later` to
/// `earlier` shifted by d, over the smallest scatter of e_0 and e_d. The gap is where the sum of e_0^2 - e_d^2,
/// from the start or to the end of the period, is largest. It counts if mean e_0^2 there exceeds mean e_d^2 by a
/// factor of 1.5 and by 8 standard deviations of noise with that spectrum (1e-15 by chance). Without a gap, a
/// shift can only increase the difference; a glitch or a transient is in both.
///
/// Sensors and actuators may have different recorders, so all channels and those of each kind are tried. One kind
/// alone needs a factor of 10, because a slow transient may look like a shift of slow signals. A gap of more
/// than 4 samples needs a factor of 10 in both kinds, and must start inside a period. Too few samples at the
/// edge of a period (1600 over the channels) are not enough; the next period reveals the gap.
///
/// A channel with its own recorder or filter may lose samples alone. It needs a factor of 30, at most 4 samples, a rest of
/// the period that repeats, and explains more than a gap of its whole kind.
///
/// d is any of -4 ... 4, or near one of the three largest peaks of the periods' cross-correlation.
/// @pre both have `dft.length()` rows
std::optional<PeriodSlip> find_slip(const LogSamples& earlier, const LogSamples& later,
                                    RealDft& dft);

}  // namespace stageid
