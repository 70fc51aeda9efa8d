#pragma once

#include <Eigen/Core>

#include "frf/runs/health_record.hpp"

namespace stageid {

/// Significance of a check over all channels.
inline constexpr double kSignificance = 1e-4;

/// Does the channel (of [sensors; actuators]) move with the excitation? F tests of the mean over periods
/// against its scatter, one a line, over the experiments; Fisher's sum over the lines; 1e-4. True
/// if one period is all there is: nothing says what noise is.
bool responds(const HealthRecord& record, Eigen::Index channel);

/// Median over the lines of the multiple coherence of one period: what of the power repeats. 1 for a
/// channel without power.
double median_coherence(const HealthRecord& record, Eigen::Index channel);

/// Condition number with the rows scaled to one, for their units differ; infinite if a row is zero.
double condition(const Eigen::MatrixXcd& M);

}  // namespace stageid
