#pragma once

#include <Eigen/Core>
#include <span>

namespace stageid {

/// Replaces the samples first ... first + count - 1 of one period, in all channels.
///
/// The new samples are the mean of the reference periods, which have the same excitation, plus a straight line
/// through what this period deviates from them before and after. Slow noise is thereby continued: without the
/// whole period, the step in it from the end of the period before to the start of the one after would leak into
/// all lines.
/// @param periods    samples x channels of each
/// @param reference  indices of the other periods to compare with, at least one
/// @pre at least one sample of the period before and after
void bridge_samples(std::span<Eigen::MatrixXf> periods, std::span<const std::size_t> reference,
                    std::size_t period, Eigen::Index first, Eigen::Index count);

}  // namespace stageid
