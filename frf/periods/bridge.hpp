#pragma once

#include <Eigen/Core>
#include <span>

#include "frf/statistics/index_range.hpp"

namespace stageid {

/// Replaces the samples `gap` of one period, in all channels.
///
/// Each becomes the mean of the reference periods, which have the same excitation, plus a straight line. The line joins
/// the deviations of this period from them just before and just after the gap. If the whole period were dropped, slow
/// noise would jump from the period before to the one after, and the jump would leak into all lines.
/// @param periods    samples x channels of each
/// @param reference  indices of the other periods to compare with, at least one
/// @pre at least one sample of the period before and after
void bridge_samples(std::span<Eigen::MatrixXf> periods, std::span<const std::size_t> reference,
                    std::size_t period, IndexRange gap);

}  // namespace stageid
