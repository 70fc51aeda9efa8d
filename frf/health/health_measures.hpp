#pragma once

#include <Eigen/Core>

#include "frf/runs/health_record.hpp"

namespace stageid {

/// Significance of a check over all channels.
inline constexpr double kSignificance = 1e-4;

/// Whether the channel (of [sensors; actuators]) moves with the excitation. One F test per line of the mean over
/// periods against its scatter, over the experiments; Fisher's sum over the lines; kSignificance. True with only
/// one period, because the noise is unknown then.
bool responds(const HealthRecord& record, Eigen::Index channel);

/// Median over the lines of the multiple coherence of one period: the share of the power that repeats. 1 for a
/// channel without power.
double median_coherence(const HealthRecord& record, Eigen::Index channel);

/// Median over the lines of the coherence between what does not repeat in two channels, corrected for its expectation
/// 1/nu if they are independent; 0 with nu = scatter_dof() < 2.
double common_motion(const HealthRecord& record, Eigen::Index one, Eigen::Index other);

/// Median over the lines of the power of noise in the means of the sensors, relative to their power.
double noise_share(const HealthRecord& record);

/// Condition number with rows of norm one, because their units differ; infinite if a row is zero.
double condition(const Eigen::MatrixXcd& M);

}  // namespace stageid
