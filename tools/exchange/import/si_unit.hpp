#pragma once

#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Replaces the units of channels by SI base or derived units without prefixes. Prefixes (um, kN, mV, mm/s^2),
/// degrees, % and a few customary units (in, ft, lbf, bar, min) are converted; kg is unchanged. Products and quotients
/// of known units are decomposed. An unknown unit ("count") is kept with factor 1.
/// Source: The International System of Units, 9th ed. (BIPM, 2019), tables 2, 4 and 7.
/// @param place of the units, for errors: "sensors"
/// @param notes receives one sentence per changed unit
/// @returns the factor of every channel: value in its new unit over value in the given one
/// @throws std::invalid_argument for 'g', which is ambiguous: gram or acceleration of gravity.
std::vector<double> take_si_units(const std::string& place, ChannelList& channels,
                                  std::vector<std::string>& notes);

/// A frequency response and its variances in SI units.
/// @throws std::invalid_argument if it has more than response and variances (covariances, the test for distortion)
void take_si_units(FrfEstimate& frf, std::vector<std::string>& notes);

}  // namespace stageid
